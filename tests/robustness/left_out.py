"""What is not in the table, and why."""

RECORDS = {
    **dict.fromkeys(
        ("FitQuality", "MeshReport", "samples.Feet", "samples.LeafScan", "samples.ScanSample", "ScanPieces"), "a result"
    ),
    **dict.fromkeys(
        ("ChartSurface", "HeightMap", "LeafFrame", "OrientedCloud", "PUInterpolant", "RBFInterpolant", "view.Camera"),
        "made by a class method, which checks",
    ),
    **dict.fromkeys(
        ("samples.LeafShape", "samples.MeshSolid", "samples.WheatPatch"), "made by a function, which checks"
    ),
    **dict.fromkeys(("Blade", "Field", "samples.Solid"), "a base, or a protocol"),
    **dict.fromkeys(
        ("Facets", "LabelledMesh", "Particles", "view.Inset", "view.Points", "view.Scalars"), "checked where it is used"
    ),
    **dict.fromkeys(("view.show", "view.pick_midrib"), "opens a window"),
}
"""Public names that no row calls."""

INNER = {
    **dict.fromkeys(
        (
            "focal_heights",
            "lift_hessians",
            "lift_with_jacobian",
            "pull_back",
            "newton_steps",
            "values",
            "jets",
            "inside",
        ),
        "takes clean arrays, from inside",
    ),
    **dict.fromkeys(("values_and_gradients", "stacked_jets", "rough_on", "rays", "framing", "size"), "the same"),
    **dict.fromkeys(("labels_of", "take", "reordered", "with_normals", "with_points", "tile_key"), "the same"),
    **dict.fromkeys(("with_period", "edge_curve", "edge_thickness", "index_of"), "the same"),
    **dict.fromkeys(("count", "index"), "of any tuple"),
}
"""Methods that no row calls."""

UNCHANGED = {"dtype"}
"""Arguments that no row spoils: NumPy tells of a type that there is not."""
