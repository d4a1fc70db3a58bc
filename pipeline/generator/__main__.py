"""`python -m pipeline.generator FOLDER` writes the motions that ship with the project."""

import argparse
from pathlib import Path

from pipeline.files import atomic
from pipeline.generator import recipes


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m pipeline.generator", description=__doc__)
    parser.add_argument("folder", type=Path, help="where to write, usually data/motions")
    folder = parser.parse_args(arguments).folder
    for name, text in recipes.texts():
        atomic.write_text(folder / name, text)
        print(f"{folder / name}  {len(text) / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
