"""The kind of value a stage says of a clip."""

Number = float | int | str | bool | None
