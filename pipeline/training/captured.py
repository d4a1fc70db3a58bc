"""Parts of a control step, captured as CUDA graphs.

Besides physics, a control step launches hundreds of kernels, each of which costs more CPU time than GPU time. A part is
called a few times, then captured once and replayed from then on. It must read and write the same memory at every step,
must not synchronize with the GPU, and has no arguments. A later part may read a tensor that an earlier part of the same
step allocated, because the earlier part is captured first. `tests/training/test_captured_steps.py` checks every part on
a CPU.
"""

import gc
from collections.abc import Callable

import torch
import warp as wp

WARM_UP = 4
"""Eager calls before capture, in which libraries allocate memory."""


class Captured:
    """A function without arguments or result: called on a CPU, replayed as a CUDA graph on a GPU."""

    def __init__(self, function: Callable[[], None], device: str, replayed: bool = True):
        self._function = function
        self._device = device
        self._replayed = replayed and device.startswith("cuda")
        self._called = 0
        self._graph: torch.cuda.CUDAGraph | None = None

    def __call__(self) -> None:
        if self._graph is not None:
            self._graph.replay()
            return
        if not self._replayed or self._called < WARM_UP:
            self._called += 1
            self._function()
            return
        self._graph = self._capture()
        self._graph.replay()

    def _capture(self) -> torch.cuda.CUDAGraph:
        """Capture on the stream on which mjlab writes the simulation's arrays; other streams are not captured."""
        graph = torch.cuda.CUDAGraph()
        stream = torch.cuda.ExternalStream(wp.get_stream(self._device).cuda_stream, device=self._device)
        gc_enabled = gc.isenabled()
        gc.collect()
        gc.disable()  # else the destruction of another object, such as a graph, could be captured
        try:
            with torch.cuda.graph(graph, stream=stream):
                self._function()
        finally:
            if gc_enabled:
                gc.enable()
        return graph
