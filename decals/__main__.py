"""``python -m decals``: the command ``implicit-decals``, also if its script is not on the PATH."""

from decals.apps.cli import main

if __name__ == "__main__":
    main()
