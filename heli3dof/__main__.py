"""Start the heli3dof command line with ``python -m heli3dof``."""

from heli3dof.cli.app import main

if __name__ == "__main__":
    main()
