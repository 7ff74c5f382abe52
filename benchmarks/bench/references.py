"""Pictures of much lower error than what is measured: drpt with MIS, kept in a folder."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.bench.metrics import own_rel_mse
from drpt import Mode
from drpt.crosscheck import measure
from drpt.crosscheck.estimate import PASSES, Estimate
from drpt.distribution import versions
from drpt.scene.saving import to_toml

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.bench.scenes import Configuration

SEED = 2**20
"""Far from those of what is measured, which count from 1."""


def reference(configuration: Configuration, spp: int, folder: Path) -> Estimate:
    """Read the reference of a configuration, or make it and keep it as NPZ, with its settings."""
    scene = to_toml(configuration.scene)
    digest = hashlib.sha256(scene.encode()).hexdigest()[:12]
    path = folder / f"{digest}-{configuration.bounces}-{spp}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        estimate = measure(configuration.scene, spp, configuration.bounces, Mode.MIS, seed=SEED)
        settings = {
            "name": configuration.name,
            "bounces": configuration.bounces,
            "spp": spp,
            "passes": estimate.passes,
            "mode": Mode.MIS,
            "sampler": "sobol",
            "seed": SEED,
            **versions(),
            "rel_mse": own_rel_mse(estimate),
            "scene": scene,
        }
        text = json.dumps(settings)
        np.savez(path, mean=estimate.mean, variance=estimate.variance, settings=text)
    with np.load(path) as stored:
        return Estimate(stored["mean"], stored["variance"], PASSES, spp)
