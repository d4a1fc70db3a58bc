"""Draw many small triangles on a matplotlib canvas in one call, instead of one polygon object each."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backend_bases import RendererBase
from matplotlib.transforms import IdentityTransform

from pipeline.viewing.projection import Triangles


class TriangleArtist(Artist):
    """Triangles of one colour each, those further on in the list on top.

    Agg widens each by half a dot, so that none of the ground shows between two that meet.
    """

    def __init__(self, triangles: Triangles) -> None:
        super().__init__()
        self._triangles = triangles

    def draw(self, renderer: RendererBase) -> None:
        """Draw them in the data coordinates of the axes that they were added to."""
        count = self._triangles.count
        if not count or self.axes is None:
            return
        corners = self.axes.transData.transform(self._triangles.corners.reshape(-1, 2)).reshape(-1, 3, 2)
        opaque = np.column_stack([self._triangles.colors, np.ones(count)])
        context = renderer.new_gc()
        renderer.draw_gouraud_triangles(context, corners, np.repeat(opaque[:, None], 3, axis=1), IdentityTransform())
        context.restore()
