"""Steps to torque: power stage, motor, screw and nut.

motor.py         motors by type name, and how they follow from a data sheet
stage.py         supply, current, microsteps; supply.py: one supply for all stages
screw.py         the screw and its nut
dynamics.py      the compiled sub-step of a stepper: command in, force on the nut out
servo.py         the sub-step of a servo drive; servo_drive.py: its data
shaft.py         rotor, screw and nut, the same for both
curves.py        pull-out torque and pull-in rate, measured on a virtual bench with it
heat.py          temperatures of the stages
report.py        the torque curve as a table and a picture; servo_report.py: that of a servo
"""
