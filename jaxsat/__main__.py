"""`python -m jaxsat`."""

from jaxsat.cli import main

if __name__ == "__main__":
    main()
