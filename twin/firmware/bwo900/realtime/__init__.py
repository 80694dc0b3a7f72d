"""What happens on the clock: blocks carried out, set points, moves in hand, power, what goes out."""
