"""The ground: a plane, or a heightfield of random roughness with a flat border (paper)."""

from mjlab.terrains import HfRandomUniformTerrainCfg, TerrainEntityCfg, TerrainGeneratorCfg

ROUGHNESS_M = 0.03
"""Height range of the rough ground [m]."""
PATCH_M = 10.0
PATCHES = 8
"""Rows and columns of patches on which episodes begin."""
BORDER_M = 30.0
"""Width of the flat border, for robots that leave the patches [m]."""


def terrain_cfg(kind: str, seed: int) -> TerrainEntityCfg:
    """Terrain of a kind: `plane` or `rough`."""
    if kind == "plane":
        return TerrainEntityCfg(terrain_type="plane")
    patch = HfRandomUniformTerrainCfg(
        noise_range=(0.0, ROUGHNESS_M), noise_step=0.005, downsampled_scale=0.2, horizontal_scale=0.1
    )
    return TerrainEntityCfg(
        terrain_type="generator",
        terrain_generator=TerrainGeneratorCfg(
            seed=seed,
            size=(PATCH_M, PATCH_M),
            border_width=BORDER_M,
            num_rows=PATCHES,
            num_cols=PATCHES,
            sub_terrains={"rough": patch},
        ),
    )
