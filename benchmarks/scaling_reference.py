"""tympan on meshes as large as the peers', run by `scaling.py` the way their scripts are."""

from __future__ import annotations

from importlib.metadata import version

from benchmarks.peers.harness import Peer, main
from benchmarks.tympan_rows import annulus, cold

if __name__ == "__main__":
    main(Peer("tympan", version("tympan"), "P4 curved triangles, log-polar", ""),
         lambda level: annulus(4, 2 * 2**level, 8 * 2**level), cold)
