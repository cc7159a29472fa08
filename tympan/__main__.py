"""``python -m tympan``."""

from tympan.cli import main

raise SystemExit(main())
