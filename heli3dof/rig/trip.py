"""Why a flight must end, in words; with what it likely comes from, and what to do then.

A watch may return a plain string as well: then nothing is known of its cause.
"""

from __future__ import annotations


class Trip(str):
    """What was seen, as text. ``cause``: the likely one; ``fix``: the command or thing to do.

    ``by_motion``: the rig moved otherwise than its voltages demand, so that the motion before may
    show which fault it is (`heli3dof.experiment.safety_monitors.wiring_fault`).
    """

    cause: str
    fix: str
    by_motion: bool

    def __new__(cls, what: str, cause: str = "", fix: str = "", *, by_motion: bool = False) -> Trip:
        trip = super().__new__(cls, what)
        trip.cause, trip.fix, trip.by_motion = cause, fix, by_motion
        return trip

    @staticmethod
    def first(*seen: str | None) -> Trip | None:
        """All that was seen, in one sentence; cause and fix are the first one's that has any."""
        said = [each for each in seen if each]
        if not said:
            return None
        known = next((s for s in said if isinstance(s, Trip) and s.cause), Trip(""))
        by_motion = any(getattr(s, "by_motion", False) for s in said)
        return Trip("; ".join(said), known.cause, known.fix, by_motion=by_motion)
