"""``python -m tests.docs.gallery``: make the pictures of docs/reference/gallery.md, and this page.

`EXAMPLES` gives each verb's commands. They run in a temporary folder, in a terminal of 100 columns;
docs/pictures/verbs/VERB.svg shows what the terminal shows. docs/pictures/report/ contains the first
screen of an HTML report, which Chromium and playwright photograph.
"""

from __future__ import annotations

import io
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.paths import ROOT

PICTURES = ROOT / "docs" / "pictures"
PAGE = ROOT / "docs" / "reference" / "gallery.md"
HEAD = """# Gallery of command output

Each picture shows one subcommand's output for an emulated rig.
"""
PHOTOGRAPHS = {
    (scheme, width): height
    for width, height in ((1300, 1000), (400, 1200))
    for scheme in ("light", "dark")
}
"""(colour scheme, width in px) → height in px of a picture of the report"""
COLUMNS, ROWS = 100, 50
LONGEST = 45
"""lines in a picture; the picture omits further ones"""
MOCK = "--device 'mock:?speed=max&seed=1'"
CABLE = "--device 'mock:?speed=max&seed=1&hide=stiffness.cable.yaw:0.1'"
REAL_TIME = "--device 'mock:?seed=1'"

RICH = f"heli3dof run rich {CABLE} -o cable.mcap --quiet"
STEPS = f"heli3dof run steps {MOCK} -o steps.mcap --quiet"
STEP = (
    "heli3dof run-step --yaw 20 --device 'mock:?speed=max&seed=2&hide=stiffness.cable.yaw:0.1' "
    "-o step.mcap --quiet"
)
DIAGNOSE = "heli3dof diagnose cable.mcap -o model.json"
PROFILE = (
    "heli3dof profile new -o rig.toml --set geometry.L_a=0.66 --set geometry.L_w=0.47 \\\n"
    "  --set geometry.L_h=0.178 --set mass.m_w=1.87 --set mass.m_f=0.575 --set mass.m_b=0.575 \\\n"
    "  --set motor.K_f=0.119 --set motor.V_o=7.45 --set motor.v_max=24 --set encoder.roll=4096 \\\n"
    "  --set encoder.pitch=4096 --set encoder.yaw=8192 --set loop.rate_hz=500"
)
FORMULA = (
    "heli3dof run rich "
    "--device 'mock:?speed=max&seed=4&hide=other.yaw_torque_from_pitch_rate:0.2' "
    "-o odd.mcap --quiet",
    "heli3dof diagnose odd.mcap -o odd.json --quiet",
)
FLYING = (
    f"heli3dof run-step --roll 10 {REAL_TIME} -o flying.mcap --quiet --force > log 2>&1 & sleep 14"
)
LANDED = "sleep 20"


@dataclass(frozen=True)
class Example:
    """A verb's entry: one sentence, the commands of the picture, and how they are run.

    ``before``, ``after``: shell commands that run without being shown; the same command runs only
    once in a gallery. ``frame``: text of a live view; the picture shows the first frame with it.
    """

    sentence: str
    commands: tuple[str, ...]
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    frame: str = ""


EXAMPLES = {
    "demo": Example(
        "`demo` flies, identifies and diagnoses an emulated rig, and writes an HTML report.",
        ("heli3dof demo",),
    ),
    "run": Example(
        "`run` flies a plan, records the flight and evaluates the step responses.",
        (f"heli3dof run steps {MOCK} -o flight.mcap",),
    ),
    "run-step": Example(
        "`run-step` flies a reference step and plots angles, references and voltages.",
        (f"heli3dof run-step --roll 10 {REAL_TIME} -o roll.mcap",),
        frame="18 of",
    ),
    "simulate": Example(
        "`simulate` flies a plan on a model instead of a rig.",
        ("heli3dof simulate steps --model hover -o simulated.mcap",),
    ),
    "compare": Example(
        "`compare` ranks models by how well they predict a flight.",
        ("heli3dof compare step.mcap hover model.json",),
        before=(RICH, f"{DIAGNOSE} --quiet", STEP),
    ),
    "diagnose": Example(
        "`diagnose` finds the physical causes of the simulation's error (here a cable).",
        (f"{DIAGNOSE} --force",),
        before=(RICH,),
    ),
    "effect": Example(
        "`effect new` writes a Python package from the formula that a diagnosis proposes.",
        ("heli3dof effect new --from odd.json",),
        before=FORMULA,
    ),
    "identify": Example(
        "`identify` fits a model to recordings and validates it on held-out data.",
        ("heli3dof identify cable.mcap --holdout step.mcap -o identified.json",),
        before=(RICH, STEP),
    ),
    "report": Example(
        "`report` writes one HTML page with all figures ([first screen](#the-html-report)).",
        ("heli3dof report cable.mcap --model hover --model model.json -o report.html",),
        before=(RICH, f"{DIAGNOSE} --quiet"),
    ),
    "fleet": Example(
        "`fleet` states what changed on which rig of a laboratory, and which rigs differ.",
        ("heli3dof fleet lab",),
        before=("python -m tests.fleet.making lab",),
    ),
    "export": Example(
        "`export` converts a recording to a table or to a log viewer's format.",
        ("heli3dof export steps.mcap -o steps.csv", "heli3dof export steps.mcap --to foxglove"),
        before=(STEPS,),
    ),
    "import": Example(
        "`import` converts another program's log; without `-o` it only lists recognised columns.",
        ("heli3dof import log.csv --profile rig.toml",),
        before=(PROFILE + " --quiet", STEPS, "heli3dof export steps.mcap -o log.csv --quiet"),
    ),
    "info": Example(
        "`info` prints how a flight ended, the angles' ranges, and step-response metrics.",
        ("heli3dof info steps.mcap",),
        before=(STEPS,),
    ),
    "plot": Example(
        "`plot` draws a flight's angles, references and voltages into a picture file.",
        ("heli3dof plot steps.mcap -o steps.svg",),
        before=(STEPS,),
    ),
    "recover": Example(
        "`recover` copies the intact part of an incomplete recording to a new file.",
        ("heli3dof recover torn.mcap",),
        before=(STEPS, "head -c 700000 steps.mcap > torn.mcap"),
    ),
    "batch": Example(
        "`batch` runs a subcommand on many recordings and writes a table row for each.",
        ("heli3dof batch identify term -o results --where 'plan=\"rich\"' --workers 1",),
        before=(RICH, STEPS, "mkdir term; cp cable.mcap steps.mcap term"),
    ),
    "devices": Example(
        "`devices` lists the rigs that heli3dof finds, the installed drivers, and the rigs in use.",
        ("heli3dof devices",),
    ),
    "doctor": Example(
        "`doctor` checks computer, disk, port and rig before the first flight.",
        (f"heli3dof doctor {REAL_TIME}",),
    ),
    "estop": Example(
        "`estop` stops a rig from another terminal while it flies.",
        (f"heli3dof estop {REAL_TIME}",),
        before=(FLYING,),
    ),
    "monitor": Example(
        "`monitor` shows live values, here during a flight.",
        (f"heli3dof monitor {REAL_TIME} --seconds 8",),
        before=("sleep 1", f"{FLYING} # again"),
        after=(LANDED,),
    ),
    "plans": Example("`plans` lists the plans that come with heli3dof.", ("heli3dof plans",)),
    "profile": Example(
        "`profile new` writes the rig's numbers into a file. "
        "`profile check` tests these and the loop's stability.",
        (PROFILE.replace("rig.toml", "lab.toml"), "heli3dof profile check lab.toml"),
    ),
    "zero": Example(
        "`zero` stores the encoder counts of the rig at rest.", (f"heli3dof zero {REAL_TIME}",)
    ),
    "exercise": Example(
        "`exercise` secretly adds effects to an emulated rig, and marks the students' answers.",
        (
            "heli3dof exercise new --seed 8 --level 2 -o next.exercise",
            "heli3dof exercise mark answers",
        ),
        before=(
            "heli3dof exercise new --seed 7 --level 2 -o rig.exercise --quiet",
            "mkdir answers; heli3dof run rich --device 'mock:?exercise=rig.exercise&speed=max' "
            "-o answers/first.mcap --quiet",
            "heli3dof diagnose answers/first.mcap --json > diagnosis.json",
            "heli3dof exercise submit diagnosis.json --name Ada -o answers/ada.json",
        ),
    ),
}
"""Verb → its entry, in the order of ``heli3dof --help``"""


def make(verbs: list[str]) -> None:
    """Write the page and the pictures of these verbs; of the report too if all verbs are given."""
    PAGE.write_text(page(), encoding="utf-8")
    (PICTURES / "verbs").mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ran: set[str] = set()
        for verb in verbs:
            svg = picture(verb, list(lines(EXAMPLES[verb], folder, ran)))
            (PICTURES / "verbs" / f"{verb}.svg").write_text(svg, encoding="utf-8")
        if (folder / "report.html").exists():
            photograph(folder / "report.html")


def page() -> str:
    """Return the text of the gallery's page."""
    parts = [HEAD]
    for verb, example in EXAMPLES.items():
        picture = f"![{verb}](../pictures/verbs/{verb}.svg)"
        parts.append(f"## {verb}\n\n{textwrap.fill(example.sentence, 120)}\n\n{picture}\n")
    parts.append("## The HTML report\n")
    for scheme, width in PHOTOGRAPHS:
        name = f"{scheme}-{width}"
        parts.append(f"![{scheme}, {width} px](../pictures/report/{name}.png)\n")
    return "\n".join(parts)


def photograph(report: Path) -> None:
    """Write the first screen of a report as PNG, at each width and colour scheme."""
    from PIL import Image

    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        chromium = None
    if chromium is None:
        print("The pictures of the report stay as they are: they need Chromium and playwright.")
        return
    pictures = PICTURES / "report"
    pictures.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for (scheme, width), height in PHOTOGRAPHS.items():
            window = {"width": width, "height": height}
            shown = browser.new_page(viewport=window, color_scheme=scheme)
            shown.goto(report.as_uri())
            shown.wait_for_timeout(1000)  # ms, until the figures are drawn
            image = Image.open(io.BytesIO(shown.screenshot(timeout=120_000))).convert("RGB")
            small = image.quantize(128, dither=Image.Dither.NONE)
            small.save(pictures / f"{scheme}-{width}.png", optimize=True)
        browser.close()


def lines(example: Example, folder: Path, ran: set[str]) -> Iterator[str]:
    """Run an example in ``folder``; yield the lines of its picture, with ANSI colours.

    ``ran``: hidden commands that have run in ``folder`` already.
    """
    for command in example.before:
        _hidden(command, folder, ran)
    for command in example.commands:
        first, *more = command.split("\n")
        yield f"\x1b[1;32m$\x1b[0m \x1b[1m{first}\x1b[0m"
        yield from (f"\x1b[1m{line}\x1b[0m" for line in more)
        shown, exit_code = in_terminal(command, folder)
        assert exit_code == 0 or command.startswith("heli3dof doctor"), f"{command}\n{shown}"
        screens = list(frames(shown))
        live = next(
            (s for s in screens[:-1] if example.frame and example.frame in "\n".join(s)), []
        )
        text = "\n".join((*live, *["…"][: len(live)], *screens[-1]))
        yield from masked(text, folder).split("\n")
    for command in example.after:
        _hidden(command, folder, ran)


def environment(folder: Path) -> dict[str, str]:
    """Return the environment of the commands: a home of their own, today's code, a terminal."""
    home, runtime = folder / ".home", folder / ".run"
    for made in (home, runtime):
        made.mkdir(mode=0o700, exist_ok=True)
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("HELI3DOF", "XDG_"))}
    return {
        **kept, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8", "HOME": str(home),
        "XDG_RUNTIME_DIR": str(runtime), "TERM": "xterm-256color", "COLORTERM": "truecolor",
    }  # fmt: skip


def _hidden(command: str, folder: Path, ran: set[str]) -> None:
    if command in ran:
        return
    ran.add(command)
    done = subprocess.run(
        ["sh", "-ec", command], cwd=folder, env=environment(folder), check=False,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, encoding="utf-8",
    )  # fmt: skip
    assert done.returncode == 0, f"{command}\n{done.stderr}"


def in_terminal(command: str, folder: Path) -> tuple[str, int]:
    """Run a command by sh in a terminal of `COLUMNS` × `ROWS`; return what it prints, exit code."""
    import fcntl
    import pty
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
    process = subprocess.Popen(
        ["sh", "-c", command], cwd=folder, env=environment(folder), start_new_session=True,
        stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    received = bytearray()
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # Linux reports the end of a terminal as an error
            part = b""
        if not part:
            break
        received += part
    os.close(ours)
    return received.decode("utf-8"), process.wait()


TOKEN = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\r|\n|[^\x1b\r\n]+")


def frames(stream: str) -> Iterator[list[str]]:
    """Yield the screen before each erasure by a live view, and the screen at the end.

    >>> list(frames("a\\r\\n10 %\\r\\x1b[2K20 %\\r\\n"))
    [['a', '10 %'], ['a', '20 %']]
    """
    screen, row = [""], 0
    for token in TOKEN.findall(stream):
        if token == "\n":
            row += 1
            screen += [""] * (row + 1 - len(screen))
        elif token.endswith("A") and token.startswith("\x1b["):
            row = max(0, row - int(token[2:-1] or 1))
        elif token == "\x1b[2K":
            if screen[row]:
                yield list(screen)
            screen[row] = ""
        elif token.startswith("\x1b[") and not token.endswith("m"):
            continue  # hides or shows the cursor
        elif token != "\r":
            screen[row] += token
    while screen and not screen[-1]:
        screen.pop()
    yield screen


MASKS = (
    (r"\bpid \d+", "pid …"),
    (r"comparisons/\d{8}-\d{6}", "comparisons/…"),
    (r"(host_time_s .*│ s +).*", r"\1│       … │       … │        … │"),
    (r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?", "…"),
    (r"(clock: )\S+, resolution .*", r"\1…"),
    (r"(other work: ).* programs ready to run, on \d+", r"\1… programs ready to run, on …"),
    (r"(memory: )\d+", r"\1…"),
    (r"[\d.]+ (GB free)", r"… \1"),
    (r"[\d.]+ (ms|µs)( at| of late|$|;|,)", r"… \1\2"),
    (r"\d+ periods late, \d+ lost; .*", "… periods late, … lost; lateness … ms, at most … ms"),
    (r"(· late by more than 1 ms:)(?s:.*?)((?:\x1b\[0m)?)\n(?=Recording:)", r"\1 …\2\n"),
    (r".*Compiling .*once.*\n", ""),
    (r"\d+ (of \d+ by more than 1 ms)", r"… \1"),
)
"""(pattern, replacement) of what differs from run to run: computer, clock, processes"""


def masked(text: str, folder: Path) -> str:
    """Return the text without what differs from run to run: folders, process ids, times."""
    text = text.replace(str(folder), "~/lab")
    for pattern, instead in MASKS:
        text = re.sub(pattern, instead, text, flags=re.MULTILINE)
    return text


def picture(verb: str, shown: list[str]) -> str:
    """Return terminal lines as SVG, at most `LONGEST`; a longer one continues in the next line."""
    from rich._export_format import CONSOLE_SVG_FORMAT
    from rich.console import Console
    from rich.text import Text

    console = Console(record=True, width=COLUMNS, file=io.StringIO(), highlight=False)
    rows: list[Text] = []
    for line in shown:
        text = Text.from_ansi(line, no_wrap=True)
        rows += text.divide(range(COLUMNS, max(len(text), 1), COLUMNS))
    if len(rows) > LONGEST:
        rows = [*rows[: LONGEST - 1], Text("…")]
    for row in rows:
        console.print(row, no_wrap=True, overflow="ignore", crop=False)
    style = re.sub(r"@font-face \{\{.*?\}\}", "", CONSOLE_SVG_FORMAT, flags=re.DOTALL)
    style = style.replace("Fira Code, monospace", FONTS)
    svg = console.export_svg(title=f"heli3dof {verb}", unique_id=verb, code_format=style)
    return re.sub(r"[ \t]+$|^\s*\n", "", svg, flags=re.MULTILINE)


FONTS = "ui-monospace, Menlo, Consolas, DejaVu Sans Mono, monospace"


if __name__ == "__main__":
    make(sys.argv[1:] or list(EXAMPLES))
