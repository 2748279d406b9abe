"""What ``heli3dof doctor`` looks at: a function for each thing, returning a `Check`.

- `host`: the computer: its clock, how it wakes up, its cores' frequency
- `folder`: where recordings go: room, and how long it takes to be safe on the disk
- `link`: the open rig: who it is, how fast and how surely it answers, what it says of itself
- `armed`: what only an armed rig shows, at zero volts, where the user asked for it

What concerns a door before it is opened (permission, holder, latency timer) is the driver's to
say (`heli3dof.rig.interface.Driver.examine`); what the system grants the loop is said by
`heli3dof.experiment.control_loop.realtime_priority`. A new check is a function in a file's
``CHECKS``.
"""
