#!/usr/bin/env bash
# sigrok-cli ends reading a dump at the first value of a bus that has two digits.
#
# Guess: a value change dump (IEEE 1364) with one wire and a counter beside it is read to its end; what is not shown, as
#        the counter, is passed over. If something cannot be read, the exit code says so.
# Seen:  of ten pulses two are there. `b0` and `b1` are passed over, `b10` ends reading, in silence, with exit code 0.
# Here:  counters stand beside the steps in a dump of a machine. They are written as real numbers, which are passed over.
# With:  sigrok-cli 0.7.2-1+b1, libsigrok4 0.5.2-4, libsigrokdecode4 0.5.3-4 of Debian 12, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
apt-get download --quiet=2 sigrok-cli=0.7.2-1+b1 libsigrok4=0.5.2-4 libsigrokdecode4=0.5.3-4 libbluetooth3 \
  libftdi1-2 libhidapi-hidraw0 libieee1284-3 libpython3.11 libserialport0 libusb-1.0-0 libzip4 2>&1 || exit 3
for package in *.deb; do dpkg --extract "$package" . || exit 3; done
export LD_LIBRARY_PATH="$PWD/usr/lib/$(uname -m)-linux-gnu"
usr/bin/sigrok-cli --version >version || exit 3
head -1 version

time=0
{
  echo '$timescale 1 us $end'
  echo '$var wire 1 s step $end'
  echo '$var wire 8 n count $end'
  echo '$enddefinitions $end'
  printf '#0\n0s\nb0 n\n'
  for number in 1 10 11 100 101 110 111 1000 1001 1010; do
    printf '#%d\n1s\nb%s n\n#%d\n0s\n' "$((time += 10))" "$number" "$((time += 10))"
  done
  echo '#210'
} >counted.vcd
sed 's/^b\(.*\) n$/r\1 n/; s/wire 8/real 64/' counted.vcd >real.vcd

pulses() {
  usr/bin/sigrok-cli --input-format vcd --input-file "$1" --output-format csv | grep '^[01]$' | uniq | grep --count 1
}
buses=$(pulses counted.vcd) && reals=$(pulses real.vcd)
echo "ten pulses, with a counter of 8 bits: $buses; with a real number: $reals"
[ "$buses $reals" = "1 10" ]
