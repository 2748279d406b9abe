"""Fits to closed-loop recordings with a known controller.

At a constant reference, the encoders may be on a limit cycle of one or two counts. It biases a fit.

- `setup`: the settings of a fit
- `base_fit`: fits the base simulation, the model to which a diagnosis adds effects
- `limit_cycle`: detects limit cycles; estimates the process noise during one
- `edge_rates`: on a limit cycle, a fit that also matches how often the encoder counts change
- `identify_correction`: corrects the bias of ``identify``'s fits to recordings with a limit cycle
"""
