"""`Trip`: why a flight must end, with the likely cause and what to do.

A safety monitor may also return a plain string; then cause and fix are unknown.
"""

from __future__ import annotations


class Trip(str):
    """A string: what the safety monitor observed. ``cause``: the likely cause; ``fix``: what to do.

    ``may_be_wiring_fault``: True if the rig did not move as its voltages demand, so a wiring fault
    may have caused the trip. `heli3dof.experiment.safety_monitors.wiring_fault` then searches the
    motion before the trip for such a fault. ``invalid_s``: the angles of the last ``invalid_s``
    seconds before the trip are invalid, because an encoder froze in the air; 0: all are valid.
    """

    cause: str
    fix: str
    may_be_wiring_fault: bool
    invalid_s: float

    def __new__(
        cls, what: str, cause: str = "", fix: str = "", *, may_be_wiring_fault: bool = False,
        invalid_s: float = 0.0,
    ) -> Trip:  # fmt: skip
        trip = super().__new__(cls, what)
        trip.cause, trip.fix = cause, fix
        trip.may_be_wiring_fault, trip.invalid_s = may_be_wiring_fault, invalid_s
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
        wiring = any(getattr(r, "may_be_wiring_fault", False) for r in given)
        invalid_s = max(getattr(r, "invalid_s", 0.0) for r in given)
        return Trip(
            "; ".join(given), explained.cause, explained.fix, may_be_wiring_fault=wiring,
            invalid_s=invalid_s,
        )  # fmt: skip
