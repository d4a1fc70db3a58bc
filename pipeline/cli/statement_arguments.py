"""What can be stated of a motion file on the command line, as in data/sources.yaml."""

from __future__ import annotations

import argparse

from pipeline.readers import Statement


def add_statement(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that `statement_of` reads."""
    group = parser.add_argument_group(
        "what the file does not say itself", "Needed only when a command asks for it. See docs/sources.md."
    )
    group.add_argument("--unit", metavar="UNIT", help="unit of length: m, cm, mm, inch, cmu, or metres per unit")
    group.add_argument("--up", metavar="AXIS", help="axis that points up: x, y, z, -x, -y, -z (write --up=-y)")
    group.add_argument("--source-fps", type=positive, metavar="HZ", help="true frame rate, over what the file declares")
    group.add_argument("--skeleton", metavar="MAP", help="name of a skeleton map, or the path of your own (.yaml)")
    group.add_argument("--asf", metavar="FILE", help="the ASF file of an AMC, from the AMC's folder")
    group.add_argument("--quaternion", choices=("wxyz", "xyzw"), help="order of a robot's root quaternion")
    group.add_argument("--body-model", metavar="NPZ", help="your own SMPL body model")


def statement_of(parsed: argparse.Namespace) -> Statement:
    """The statement that was typed; None in it is what was not."""
    return Statement(
        unit=parsed.unit,
        up=parsed.up,
        fps=parsed.source_fps,
        skeleton=parsed.skeleton,
        asf=parsed.asf,
        body_model=parsed.body_model,
        quaternion=parsed.quaternion,
    )


def positive(text: str) -> float:
    """A frame rate: more than 0, at most 1000 [Hz]. For argparse."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text} is not a rate in Hz, wanted more than 0 and at most 1000")
    return value
