"""``heli3dof plans``: lists the plans that come with heli3dof."""

from __future__ import annotations

import typer

from heli3dof.cli.output import Output, verb


def register(app: typer.Typer) -> None:
    app.command("plans", rich_help_panel="Plans and rigs")(plans)


@verb
def plans(out: Output) -> None:
    """List the plans that come with heli3dof: duration, content and purpose.

    Example: heli3dof plans
    """
    from rich.table import Table

    from heli3dof.experiment.plan import load_plan, named_plans

    table = Table("plan", "duration", "content", "purpose")
    listed = []
    for name, path in named_plans().items():
        plan = load_plan(name)
        table.add_row(name, f"{plan.duration_s:g} s", plan.description, plan.purpose)
        listed.append(
            {
                "name": name,
                "duration_s": plan.duration_s,
                "description": plan.description,
                "purpose": plan.purpose,
                "segments": plan.summary(),
                "file": str(path),
            }
        )
    out.show(table)
    out.note("Fly a plan: heli3dof run NAME. Its keys: docs/reference/plans.md")
    out.emit({"schema": "heli3dof.plans/1", "plans": listed})
