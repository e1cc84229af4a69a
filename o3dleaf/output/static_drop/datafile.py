"""The data file of a static drop for Surface Evolver."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.output.static_drop.cap import cap_mesh, cap_radius
from o3dleaf.output.static_drop.ground import CosineSeries

RINGS = (5, 12)
"""Fewest and most rings of triangles of the first surface, six more in each; Evolver makes four of each, and curved."""
PER_WAVE = 4.5
"""Rings, times the shortest wave, of the radius of the base: an edge of the line is an eighth of a wave then."""


@dataclass(frozen=True, eq=False)
class StaticDrop:
    """A drop at rest on a surface.

    Attributes
    ----------
    ground : CosineSeries
        The surface's height around the drop, in meters.
    angle : float
        Contact angle in degrees.
    diameter : float
        Of a ball of its volume, in meters.
    tension : float
        In N/m.
    density : float
        In kg/m³.
    gravity : float
        In m/s², down along −z.
    about : str
        A line of comment.
    """

    ground: CosineSeries
    angle: float
    diameter: float
    tension: float = 0.072
    density: float = 998.0
    gravity: float = 9.81
    about: str = ""

    @property
    def radius(self) -> float:
        """The unit of length in the file: that of a ball of the drop's volume, in meters."""
        return self.diameter / 2

    @property
    def bond_number(self) -> float:
        """Weight against tension, ρ g R²/σ."""
        return self.density * self.gravity * self.radius**2 / self.tension

    @property
    def rings(self) -> int:
        """Rings of triangles that Evolver starts with: its edges are to follow the waves under the line of contact."""
        angle = np.radians(self.angle)
        base = self.radius * cap_radius(angle) * np.sin(angle)
        return int(np.clip(np.ceil(PER_WAVE * base / self.ground.shortest_wave), *RINGS))

    def text(self) -> str:
        """Return the data file."""
        ground = self.ground.scaled(1 / self.radius)
        # The plane z = 0 is at the mean height.
        height = float(ground.coefficients[0, 0])
        ground = ground.raised(-height)
        vertices, triangles, on_line = cap_mesh(np.radians(self.angle), self.rings)
        inner = len(vertices) - on_line
        under, top = ground(vertices[:, 0], vertices[:, 1]), vertices[:, 2].max()
        vertices[:, 2] += under * (1 - vertices[:, 2] / top)
        return "\n".join([*self._head(height), *_quantities(ground), *_elements(vertices, triangles, inner), COMMANDS])

    def _head(self, height: float) -> list[str]:
        """Return comments and constants."""
        about = [f"// {line}" for line in (self.about, "A drop at rest, for Surface Evolver.") if line]
        return [
            *about,
            f"// Lengths are in {self.radius:.9g} m, the radius of a ball of its volume; energies in tension times its",
            f"// square. z = 0 is {height * self.radius:.9g} m above the plane that heights were measured from.",
            f"// diameter {self.diameter:.9g} m, tension {self.tension:.9g} N/m,",
            f"// density {self.density:.9g} kg/m3, gravity {self.gravity:.9g} m/s2",
            "",
            f"parameter contact_angle = {self.angle:.9g}  // degrees",
            f"parameter bond_number = {self.bond_number:.12g}  // density * gravity * radius^2 / tension",
            f"parameter unit_length = {self.radius:.12g}  // meters",
            "",
        ]


def _quantities(ground: CosineSeries) -> list[str]:
    """Return the surface as a constraint, and what is integrated over the drop's surface and along its line.

    Over the wetted part, which is not meshed, integrals ∬ f dx dy are those along the line, ∮ ∫ f dx dy.
    """
    stretch = ground.derived(lambda _, slopes: np.sqrt(1 + np.einsum("ni,ni->n", slopes, slopes)))
    square = ground.derived(lambda heights, _: heights**2 / 2)
    below = ground.integral()
    return [
        "// vertices of the line of contact keep their direction from the middle, or they would crowd",
        "define vertex attribute east real",
        "define vertex attribute north real",
        "constraint 2",
        "formula: x*north - y*east = 0",
        "",
        "constraint 1  // the surface",
        f"formula: z = {ground.expression()}",
        "",
        "// the wetted area, with the energy that the contact angle gives it",
        *_edge("wetted", stretch.integral()),
        "quantity wetting_energy energy modulus -cos(contact_angle*pi/180) method wetted",
        "",
        "// the volume",
        *_face("volume_top", "z"),
        *_edge("volume_foot", f"-({below})"),
        f"quantity drop_volume fixed = {4 * np.pi / 3:.15g} method volume_top method volume_foot",
        "",
        "// the weight",
        *_face("weight_top", "z^2/2"),
        *_edge("weight_foot", f"-({square.integral()})"),
        "quantity drop_weight energy modulus bond_number method weight_top method weight_foot",
        "",
        "// the drop is held over its place, its center of mass at x = y = 0",
        *_face("x_top", "x*z"),
        *_edge("x_foot", f"-({ground.moment()})"),
        "quantity middle_x fixed = 0 method x_top method x_foot",
        *_face("y_top", "y*z"),
        *_edge("y_foot", f"-(y*({below}))"),
        "quantity middle_y fixed = 0 method y_top method y_foot",
        "",
    ]


def _edge(name: str, integrand: str) -> list[str]:
    """Return ∮ f dy along the line of contact."""
    return [
        f"method_instance {name} method edge_vector_integral",
        "vector_integrand:",
        "q1: 0",
        f"q2: {integrand}",
        "q3: 0",
    ]


def _face(name: str, integrand: str) -> list[str]:
    """Return ∬ f dx dy over the drop's surface."""
    return [
        f"method_instance {name} method facet_vector_integral",
        "vector_integrand:",
        "q1: 0",
        "q2: 0",
        f"q3: {integrand}",
    ]


def _elements(vertices: FloatArray, triangles: IntArray, inner: int) -> list[str]:
    """Return vertices, edges and faces; vertices from `inner` on are on the line of contact."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges, first, number = np.unique(np.sort(ends, axis=1), axis=0, return_index=True, return_inverse=True)
    # Those of the line run as their triangle does: counter-clockwise seen from above.
    once = np.bincount(number.ravel(), minlength=len(edges)) == 1
    edges[once] = ends[first[once]]
    forward = (edges[number.ravel()] == ends).all(axis=1)
    signed = (number.ravel() + 1) * np.where(forward, 1, -1)
    of_line = "constraint 1 wetted volume_foot weight_foot x_foot y_foot"
    of_face = "volume_top weight_top x_top y_top"
    return [
        "vertices",
        *(
            f"{n + 1} {x:.12g} {y:.12g} {z:.12g}" + (" constraint 1" if n >= inner else "")
            for n, (x, y, z) in enumerate(vertices)
        ),
        "",
        "edges",
        *(
            f"{n + 1} {a + 1} {b + 1}" + (f" {of_line}" if line else "")
            for n, ((a, b), line) in enumerate(zip(edges, once, strict=True))
        ),
        "",
        "faces",
        *(f"{n + 1} {a} {b} {c} {of_face}" for n, (a, b, c) in enumerate(signed.reshape(-1, 3))),
        "",
    ]


COMMANDS = """read

// to rest: descent while triangles are few and flat, then Newton's method with curved ones, and with four times as many
aim := {
  set vertex east x/sqrt(x^2+y^2) where on_constraint 1;
  set vertex north y/sqrt(x^2+y^2) where on_constraint 1;
  set vertex constraint 2 where on_constraint 1;
}
settle := {
  aim; g 30; u; V; g 30; V; g 30; quadratic; aim; g 20; V; g 20;
  { hessian_seek; g 3 } 6; hessian; hessian;
  r; aim; g 5; hessian_seek; hessian; hessian; hessian;
}

// what was found, for the program that asked; lines begin with a word
say := {
  printf "total %.15g volume %.15g wetted %.15g pressure %.15g force %.15g %.15g\\n",
    total_energy, drop_volume.value, wetted.value, drop_volume.pressure, middle_x.pressure, middle_y.pressure;
  foreach vertex vv do printf "vertex %d %.15g %.15g %.15g\\n", vv.id, vv.x, vv.y, vv.z;
  foreach edge ee where on_constraint 1 do
    printf "line %d %d %d\\n", ee.vertex[1].id, ee.vertex[3].id, ee.vertex[2].id;
  foreach facet ff do printf "face %d %d %d %d %d %d\\n", ff.vertex[1].id, ff.vertex[2].id, ff.vertex[3].id,
    ff.edge[1].vertex[3].id, ff.edge[2].vertex[3].id, ff.edge[3].vertex[3].id;
}
"""
