"""Steps to torque: power stage, motor, screw and nut.

motor.py         a motor as data, and how it follows from a data sheet; library.py: motors by type name
stage.py         supply, current, microsteps; supply.py: one supply for all stages
screw.py         the screw and its nut
stepper.h        the sub-step of a stepper: command in, torque out; dynamics.py: its constants
servo.h          the sub-step of a servo drive; servo.py: its constants; servo_drive.py: its data
shaft.h          rotor, screw and nut, the same for both; shaft.py: their records
curves.py        pull-out torque and pull-in rate, measured on a virtual bench with it
stability.py     whether a small swing of the rotor grows, and the speed from which on it does
spindle.py       the working spindle: converter, rotor, load
heat.py          temperatures of the stages
report.py        the torque curve as a table and a picture; servo_report.py: that of a servo
"""
