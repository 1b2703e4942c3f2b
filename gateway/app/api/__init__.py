"""The Python interface of this package: frames of both protocols, and a gateway inside another program."""
