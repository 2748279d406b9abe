"""`Trip`: why a flight must end, with the likely cause and what to do.

A safety monitor may also return a plain string; then cause and fix are unknown.
"""

from __future__ import annotations


class Trip(str):
    """A string: what the safety monitor observed. ``cause``: the likely cause; ``fix``: what to do.

    ``by_motion``: the rig moved differently from what its voltages demand, so the motion before the
    trip may show the fault (`heli3dof.experiment.safety_monitors.wiring_fault`). ``invalid_s``: the
    last seconds before the trip, whose angles are invalid because an encoder froze in the air. Only
    the motion before these seconds is evidence; 0: all angles are valid.
    """

    cause: str
    fix: str
    by_motion: bool
    invalid_s: float

    def __new__(
        cls, what: str, cause: str = "", fix: str = "", *, by_motion: bool = False,
        invalid_s: float = 0.0,
    ) -> Trip:  # fmt: skip
        trip = super().__new__(cls, what)
        trip.cause, trip.fix, trip.by_motion, trip.invalid_s = cause, fix, by_motion, invalid_s
        return trip

    @staticmethod
    def first(*reasons: str | None) -> Trip | None:
        """Return one `Trip` with all given reasons and the first known cause, with its fix.

        Returns None if every reason is None or empty.
        """
        given = [each for each in reasons if each]
        if not given:
            return None
        explained = next((r for r in given if isinstance(r, Trip) and r.cause), Trip(""))
        by_motion = any(getattr(r, "by_motion", False) for r in given)
        invalid_s = max(getattr(r, "invalid_s", 0.0) for r in given)
        return Trip(
            "; ".join(given), explained.cause, explained.fix, by_motion=by_motion,
            invalid_s=invalid_s,
        )  # fmt: skip
