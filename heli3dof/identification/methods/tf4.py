"""Define the method ``tf4``: fourth-order transfer functions in the paper's form, eq (17)."""

from heli3dof.identification.method import Method

METHOD = Method(
    "tf4",
    "the paper's form: common fourth-order denominator, output error",
    "heli3dof.identification.black_box.tf4_method:fit",
    assumes_open_loop=True,
)
