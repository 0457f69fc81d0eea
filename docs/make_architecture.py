"""Draw docs/architecture.svg: the packages, and which import which, read from the code itself.

python docs/make_architecture.py           write the picture
python docs/make_architecture.py check     exit 1 if the picture is out of date

An arrow leads from a package to one that it imports; arrows that follow from others, and UPWARDS,
are left out.
"""

import ast
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "architecture.svg"

# Where each package is drawn: column and row, from the bottom up.
FOUNDATION = {"events, errors, files, settings": (1.0, 0)}
FOUNDATION |= {"worlds": (1.0, 1), "robots": (1.0, 2), "scenario": (1.0, 3), "recording": (1.0, 4)}
PLANNING = {"kernels": (0.0, 5), "planners": (0.0, 6), "runs": (0.4, 8)}
READING = {"formats": (2.2, 5), "collision": (1.5, 5), "replay": (1.9, 6), "verification": (1.5, 7)}
READING |= {"comparison": (2.08, 7), "explanation": (1.6, 8), "views": (2.3, 8)}
READING |= {"recorder": (2.62, 6), "exports": (2.65, 7), "ompl": (2.5, 9)}
TOP = {"testing": (0.7, 9), "cli": (1.4, 10)}
UPWARDS = {("recording", "exports")}  # methods for users, which import when they are called
COLOURS = ((FOUNDATION, "#dfe7ef"), (PLANNING, "#f6e3cf"), (READING, "#dcefdc"), (TOP, "#eee6f3"))
PLACES = FOUNDATION | PLANNING | READING | TOP
WIDTH, HEIGHT, BOX, ROW, COLUMN = 1010, 640, (190, 34), 54, 290


def package_of(module: str) -> str | None:
    """Return the box that a module of brrt or of the command line is drawn in."""
    parts = module.split(".")
    if parts[0] == "cli":
        return "cli"
    if len(parts) < 2:
        return None
    name = parts[1]
    return name if name in PLACES else next(iter(FOUNDATION))


def imports(path: Path) -> set[str]:
    """Return the modules of brrt that a file imports, at its top or inside its functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            if node.module == "brrt":
                found |= {f"brrt.{alias.name}" for alias in node.names}
            elif node.module.startswith("brrt."):
                found.add(node.module)
    return found


def arrows() -> set[tuple[str, str]]:
    """Return which package imports which."""
    found = set()
    for path in [*ROOT.glob("brrt/**/*.py"), *ROOT.glob("cli/**/*.py")]:
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for imported in imports(path):
            pair = package_of(module), package_of(imported)
            if pair[0] and pair[1] and pair[0] != pair[1]:
                found.add((pair[0], pair[1]))
    return found - UPWARDS


def reduced(edges: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Leave out arrows that follow from a chain of others."""

    def reaches(a: str, b: str, without: tuple[str, str]) -> bool:
        ahead, seen = [a], set[str]()
        while ahead:
            at = ahead.pop()
            seen.add(at)
            following = {y for x, y in edges if x == at and (x, y) != without} - seen
            if b in following:
                return True
            ahead += following
        return False

    return {edge for edge in edges if not reaches(*edge, without=edge)}


def picture() -> str:
    """Return the picture as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"',
        'font-family="sans-serif" font-size="15">',
        '<defs><marker id="a" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8"',
        'markerHeight="8" orient="auto"><path d="M0 0L8 4L0 8z" fill="#555"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for text, x, y in (("planning wing", 30, 60), ("reading wing", WIDTH - 130, 60)):
        parts.append(f'<text x="{x}" y="{y}" fill="#777">{text}</text>')
    parts.append(f'<text x="30" y="{HEIGHT - 20}" fill="#777">foundation</text>')
    for a, b in sorted(reduced(arrows())):
        (ax, ay), (bx, by) = middle(a), middle(b)
        parts.append(
            f'<line x1="{ax:.0f}" y1="{ay + BOX[1] / 2:.0f}" x2="{bx:.0f}" '
            f'y2="{by - BOX[1] / 2 - 2:.0f}" stroke="#555" marker-end="url(#a)"/>'
        )
    for group, colour in COLOURS:
        for name in group:
            at, up = middle(name)
            wide = max(BOX[0] - 60, 9 * len(name))
            parts.append(
                f'<rect x="{at - wide / 2:.0f}" y="{up - BOX[1] / 2:.0f}" width="{wide}" '
                f'height="{BOX[1]}" rx="5" fill="{colour}" stroke="#888"/>'
                f'<text x="{at:.0f}" y="{up + 5:.0f}" text-anchor="middle">{name}</text>'
            )
    return "\n".join([*parts, "</svg>", ""])


def middle(name: str) -> tuple[float, float]:
    """Return where the middle of a box is, in pixels."""
    column, row = PLACES[name]
    return 140 + COLUMN * column, HEIGHT - 40 - ROW * row


if __name__ == "__main__":
    if sys.argv[1:] == ["check"]:
        current = PICTURE.read_text("utf-8") == picture()
        sys.exit(0 if current else "docs/architecture.svg is out of date; draw it again")
    PICTURE.write_text(picture(), "utf-8")
