"""What other programs may use of this package: frames of both protocols, and a gateway inside a program."""
