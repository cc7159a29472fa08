"""α and stroke over aspect ratio and plate size of elliptical frames, and a formula for α."""
