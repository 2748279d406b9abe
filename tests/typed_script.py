"""A user's script, which mypy checks (`pyproject.toml`): the calls that the package documents.

It is never run: its files do not exist.
"""

from __future__ import annotations

import numpy as np

import heli3dof as h3

profile: h3.Profile = h3.default_profile()
flight: h3.Flight = h3.fly_plan("rich", device="mock:?speed=max", seed=3)
h3.fly_plan(h3.step_plan(roll=10), profile="rig.toml")
recording: h3.Recording = flight.recording
part: h3.Recording = recording.between(1.0, 2.0)
found: h3.Identification = h3.identify("flight.mcap", method="pem", holdout="b.mcap")
h3.identify([recording, "a.mcap"], terms="+motor.lag", intervals_s=0.04)
comparison: h3.Comparison = h3.compare(recording, "hover")
h3.compare("flight.mcap", [found.model, "m.json"], horizons_s=1.0)
h3.compare([recording], lambda r: [h3.hover_model(r.profile)])
diagnosis: h3.Diagnosis = h3.diagnose("flight.mcap", "b.mcap")
h3.next_experiment(diagnosis)
simulated: h3.Recording = h3.simulate("steps", "m.json", profile="rig.toml")
h3.save_model(found.model, "x.json")
response, std = found.frequency_response(np.logspace(-1, 1, 10))
page: str = h3.flight_report(recording, models="hover", identified=found, diagnosed=diagnosis)
h3.make_recording(recording.t, recording.voltage, recording.angle, profile)
with h3.open_rig("mock:", "rig.toml") as rig:
    sample: h3.Sample = rig.arm()
    sample = rig.exchange(h3.Command(1, 7.0, 7.0), sample.host_time_s + profile.dt)
model = h3.load_model("m.json", "rig.toml")
poles = h3.check_loop(model, profile.with_controller().controller, profile.dt)
model.to_control(dt=0.02)
recording.to_dataframe()
h3.run_auto("rich", device="mock:", folder="x", profile="rig.toml")
h3.export("flight.mcap", "x.csv")
h3.write_recording("a.mcap", "b.mcap")
h3.flight_metrics("a.mcap")
h3.zero("mock:", "rig.toml", angles_deg=(None, 0.0, 0.0))
