"""Parts of a control step that a GPU replays as CUDA graphs.

A control step has hundreds of kernel launches beside physics, each of which takes the processor longer than the GPU. A
part is called a few times, then recorded once and replayed from then on. It may therefore only read and write memory
that is the same at every step, must not ask for a number that the GPU computes, and has no arguments. What a later part
reads of an earlier one in the same step may be a new tensor, since the earlier part is recorded first.
`tests/training/test_captured_steps.py` checks every part on a CPU.
"""

import gc
from collections.abc import Callable

import torch
import warp as wp

WARM_UP = 4
"""Calls before a part is recorded: libraries allocate in the first ones."""


class Captured:
    """A function without arguments or result; called on a CPU, replayed on a GPU."""

    def __init__(self, work: Callable[[], None], device: str, replayed: bool = True):
        self._work = work
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
            self._work()
            return
        self._graph = self._recorded()
        self._graph.replay()

    def _recorded(self) -> torch.cuda.CUDAGraph:
        """Record on the stream on which mjlab writes the simulation's arrays; other streams are not recorded."""
        graph = torch.cuda.CUDAGraph()
        stream = torch.cuda.ExternalStream(wp.get_stream(self._device).cuda_stream, device=self._device)
        collects = gc.isenabled()
        gc.collect()
        gc.disable()  # else the destruction of another object, such as a graph, could be recorded
        try:
            with torch.cuda.graph(graph, stream=stream):
                self._work()
        finally:
            if collects:
                gc.enable()
        return graph
