"""The clip of a manifest's entry, for display."""

from __future__ import annotations

from pipeline.batch import Entry, Store
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Clip


def entry_clip(store: Store, entry: Entry) -> Clip:
    """The clip, cut to its window if it is a selected window of a human motion.

    KP1 keeps the whole recording with each window (`start_frame`, `stop_frame`); from KP2 on the clip is the window.
    """
    clip = store.get_clip(entry.blob, entry.clip)
    start, stop = entry.numbers.get("start_frame"), entry.numbers.get("stop_frame")
    if not isinstance(clip, HumanClip) or start is None or stop is None or stop - start >= clip.frame_count:
        return clip
    return clip.cut(int(start), int(stop), clip.name)
