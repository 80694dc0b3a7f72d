"""MTConnect: an adapter beside a served twin, which agents connect to.

items.py      the data items: Devices.xml, and their values from a state of the control port
adapter.py    SHDR over TCP
"""
