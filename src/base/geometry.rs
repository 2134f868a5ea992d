//! Points, directions, boxes, axes, faces of the domain and triangulated surfaces, as written in a case.

use crate::error::Report;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A point, direction or velocity: a list of two numbers in 2-D and of three in 3-D.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline, extend("minItems" = 2, "maxItems" = 3))]
pub struct Vector(pub Vec<f64>);

impl Vector {
    /// Returns three components; a missing third one is zero.
    #[must_use]
    pub fn to_array(&self) -> [f64; 3] {
        let mut array = [0.0; 3];
        for (to, from) in array.iter_mut().zip(&self.0) {
            *to = *from;
        }
        array
    }

    /// Returns the three components; reports a finding if their number differs from the dimension.
    pub fn resolve(&self, dimension: usize, path: &str, report: &mut dyn Report) -> [f64; 3] {
        let have = self.0.len();
        if have != dimension {
            report.wrong_components(
                path,
                format!("this has {have} components, but the problem is {dimension}-D"),
                format!("write {dimension} numbers").into(),
            );
        }
        self.to_array()
    }
}

/// Uniform velocity, as a list or as an object with `velocity`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "WrittenVelocity")]
#[schemars(inline)]
pub struct UniformVelocity {
    /// Velocity [m/s].
    pub velocity: Vector,
}

/// Uniform velocity: the list of its components, or an object.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
enum WrittenVelocity {
    /// Velocity [m/s].
    Velocity(Vector),
    /// The velocity as a field.
    Fields(NamedVelocity),
}

/// The velocity as a field.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
struct NamedVelocity {
    /// Velocity [m/s].
    velocity: Vector,
}

impl From<WrittenVelocity> for UniformVelocity {
    fn from(written: WrittenVelocity) -> Self {
        match written {
            WrittenVelocity::Velocity(velocity)
            | WrittenVelocity::Fields(NamedVelocity { velocity }) => Self { velocity },
        }
    }
}

/// An angular velocity [rad/s]: one number in 2-D (about z, counter-clockwise), three in 3-D.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub enum Rotation {
    /// Rate about z [rad/s], in 2-D.
    AboutZ(f64),
    /// Angular velocity vector [rad/s], in 3-D.
    Vector([f64; 3]),
}

impl Default for Rotation {
    fn default() -> Self {
        Self::AboutZ(0.0)
    }
}

impl Rotation {
    /// Returns the angular velocity vector; in 2-D only its third component is nonzero.
    #[must_use]
    pub fn to_array(&self) -> [f64; 3] {
        match self {
            Self::AboutZ(rate) => [0.0, 0.0, *rate],
            Self::Vector(vector) => *vector,
        }
    }
}

/// An axis-parallel box [m] (a rectangle in 2-D).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// The corner with the smallest coordinates [m].
    pub from: Vector,
    /// The corner with the largest coordinates [m].
    pub to: Vector,
}

/// Part of the domain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// Axis-parallel box.
    Box(Extent),
    /// The space between two planes normal to an axis.
    Layer(Layer),
}

/// The space between two planes normal to an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// Axis normal to the layer. Default: y in 2-D, z in 3-D.
    #[serde(default)]
    pub axis: Option<Axis>,
    /// Coordinate of the lower plane [m]. Default: no lower plane.
    #[serde(default)]
    pub from: Option<f64>,
    /// Coordinate of the upper plane [m]. Default: no upper plane.
    #[serde(default)]
    pub to: Option<f64>,
}

/// Triangulated surface from a file. Triangles that share corners form one smooth surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// STL file, text or binary, relative to the case.
    pub path: PathBuf,
    /// Length of the unit of the file [m]: 0.001 for a file in mm.
    #[serde(default = "one")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: f64,
    /// Position of the origin of the file in the domain [m]. Default: the origin of the domain.
    #[serde(default)]
    pub origin: Option<Vector>,
}

/// A polyline of a drawing: the only one of its layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrawnLayer {
    /// DXF file as text (R12 or newer), relative to the case.
    pub path: PathBuf,
    /// Layer with one LWPOLYLINE or POLYLINE in the plane of x and y.
    pub layer: String,
    /// Length of the unit of the drawing [m]: 0.001 for mm. Default: that of the drawing (`$INSUNITS`).
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: Option<f64>,
    /// Position of the origin of the drawing in the domain [m]. Default: the origin of the domain.
    #[serde(default)]
    pub origin: Option<[f64; 2]>,
    /// Largest distance between an arc and the chords that replace it [m]. Default: a thousandth of the extent of the
    /// polyline.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tolerance: Option<f64>,
}

fn one() -> f64 {
    1.0
}

/// Axis of the domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Axis {
    /// First axis.
    X,
    /// Second axis.
    Y,
    /// Third axis (3-D only).
    Z,
}

impl Axis {
    /// Returns the index 0, 1 or 2.
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }

    /// Returns the name `x`, `y` or `z`.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["x", "y", "z"][self.index()]
    }
}

/// Face of the domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(inline)]
pub enum Face {
    /// x = 0.
    XMin,
    /// x = size of the domain along x.
    XMax,
    /// y = 0.
    YMin,
    /// y = size of the domain along y.
    YMax,
    /// z = 0 (3-D only).
    ZMin,
    /// z = size of the domain along z (3-D only).
    ZMax,
}

impl Face {
    /// All faces, in the order of [`Face::index`].
    pub const ALL: [Self; 6] = [
        Self::XMin,
        Self::XMax,
        Self::YMin,
        Self::YMax,
        Self::ZMin,
        Self::ZMax,
    ];

    /// Returns the index of the face in [`Face::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Self::XMin => 0,
            Self::XMax => 1,
            Self::YMin => 2,
            Self::YMax => 3,
            Self::ZMin => 4,
            Self::ZMax => 5,
        }
    }

    /// Returns the axis normal to the face: 0, 1 or 2.
    #[must_use]
    pub fn axis(self) -> usize {
        self.index() / 2
    }

    /// Returns `true` if the face is at the upper end of its axis.
    #[must_use]
    pub fn is_max(self) -> bool {
        self.index() % 2 == 1
    }

    /// Returns the unit vector that points from the face into the domain.
    #[must_use]
    pub fn inward(self) -> [f64; 3] {
        let mut normal = [0.0; 3];
        normal[self.axis()] = if self.is_max() { -1.0 } else { 1.0 };
        normal
    }

    /// Returns the name of the face in a case: `x_min` and so on.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"][self.index()]
    }
}
