"""``python -m heli3dof``: the command line."""

from heli3dof.cli.app import main

if __name__ == "__main__":
    main()
