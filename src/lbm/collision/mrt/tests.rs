use super::super::bgk::Bgk;
use super::super::trt::{AntisymmetricRate, Trt, antisymmetric_rate};
use super::*;
use crate::collision::Collision;
use crate::initial::equilibrium;
use crate::lattice::{D3Q27, Lattice};

pub(in super::super) const FORCE: [f64; 3] = [0.011, -0.007, 0.003];

/// Returns the deviations of a cell far from equilibrium.
pub(in super::super) fn cell(seed: u64) -> [f64; 27] {
    std::array::from_fn(|i| {
        let x = (seed * 27 + i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11;
        (x as f64 / (1_u64 << 53) as f64 - 0.5) * 0.2 * D3Q27::W[i].sqrt()
    })
}

/// Returns the integer matrix of Suga with a rate for each row.
fn rows(omega: f64, k: &Rates) -> Vec<([f64; 27], f64)> {
    let text = include_str!("../../../../tests/reference/suga_d3q27.csv");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let order: Vec<[i8; 3]> = lines
        .next()
        .unwrap()
        .split(',')
        .skip(2)
        .map(|c| {
            let c: Vec<i8> = c
                .trim_matches(['(', ')'])
                .split(' ')
                .map(|x| x.parse().unwrap())
                .collect();
            [c[0], c[1], c[2]]
        })
        .collect();
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let rate = match cells[0] {
                "rho" | "jx" | "jy" | "jz" => 0.0,
                "e" => k.bulk,
                "3pxx" | "pww" | "pxy" | "pyz" | "pzx" => omega,
                "qx" | "qy" | "qz" => k.q,
                "Psi_x" | "Psi_y" | "Psi_z" => k.psi,
                "eps" => k.epsilon,
                "e3" => k.e_cubed,
                "XX" | "WW" => k.xx,
                "XY" | "YZ" | "ZX" => k.xy,
                "tau_x" | "tau_y" | "tau_z" => k.tau,
                "XYZ" => k.xyz,
                other => panic!("{other}"),
            };
            let mut row = [0.0; 27];
            for (c, x) in order.iter().zip(&cells[2..]) {
                let i = D3Q27::C.iter().position(|d| d == c).unwrap();
                row[i] = x.parse().unwrap();
            }
            (row, rate)
        })
        .collect()
}

/// Inner product of moments in which a matrix is orthogonal.
#[derive(Clone, Copy, PartialEq)]
pub(in super::super) enum Orthogonal {
    /// Product in which each velocity counts once: the matrix of Suga.
    Plain,
    /// Product in which each velocity counts by its weight: Gram-Schmidt of the rows of Suga, in their order.
    Weighted,
}

impl Orthogonal {
    fn product(self, a: &[f64; 27], b: &[f64; 27]) -> f64 {
        let weight = |i: usize| {
            if self == Self::Plain {
                1.0
            } else {
                D3Q27::W[i]
            }
        };
        (0..27).map(|i| weight(i) * a[i] * b[i]).sum()
    }

    fn matrix(self, omega: f64, k: &Rates) -> Vec<([f64; 27], f64)> {
        let mut done: Vec<([f64; 27], f64)> = Vec::new();
        for (mut row, rate) in rows(omega, k) {
            for (other, _) in &done {
                let part = self.product(&row, other) / self.product(other, other);
                for i in 0..27 {
                    row[i] -= part * other[i];
                }
            }
            done.push((row, rate));
        }
        done
    }
}

/// Returns the whole matrix.
pub(in super::super) fn reference(
    basis: Orthogonal,
    g: &[f64; 27],
    omega: f64,
    k: &Rates,
    force: [f64; 3],
) -> [f64; 27] {
    let drho: f64 = g.iter().sum();
    let u: [f64; 3] = std::array::from_fn(|a| {
        let j: f64 = (0..27).map(|i| f64::from(D3Q27::C[i][a]) * g[i]).sum();
        (j + 0.5 * force[a]) / (1.0 + drho)
    });
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mut out = *g;
    for (row, rate) in basis.matrix(omega, k) {
        let (mut short, mut source) = (0.0, 0.0);
        let norm = basis.product(&row, &row);
        for i in 0..27 {
            let c = D3Q27::C[i].map(f64::from);
            let guo = 3.0 * (dot(c, force) - dot(u, force)) + 9.0 * dot(c, u) * dot(c, force);
            short += row[i] * (equilibrium(D3Q27::W[i], D3Q27::C[i], drho, u) - g[i]);
            source += row[i] * D3Q27::W[i] * guo;
        }
        for i in 0..27 {
            let dual = row[i] / norm
                * if basis == Orthogonal::Plain {
                    1.0
                } else {
                    D3Q27::W[i]
                };
            out[i] += dual * (rate * short + (1.0 - 0.5 * rate) * source);
        }
    }
    out
}

pub(in super::super) fn close(a: &[f64; 27], b: &[f64; 27]) {
    for i in 0..27 {
        assert!((a[i] - b[i]).abs() < 2e-16 * 27.0, "{i}: {} {}", a[i], b[i]);
    }
}

pub(in super::super) fn collided<C: Collision>(operator: C, g: &[f64; 27]) -> [f64; 27] {
    let mut g = *g;
    operator.collide::<D3Q27, f64, _, 27>(&mut g, &operator.uniform());
    g
}

#[test]
fn the_factorised_form_is_the_matrix() {
    let basis = Orthogonal::Weighted;
    for seed in 0..20 {
        let g = cell(seed);
        for omega in [0.3, 1.1, 1.99] {
            let (rates, none) = (Rates::SUGA, [0.0; 3]);
            let plain = Mrt::<false> {
                omega,
                rates,
                force: none,
            };
            let exact = reference(basis, &g, omega, &rates, none);
            close(&collided(plain, &g), &exact);
            let forced = Mrt::<true> {
                omega,
                rates,
                force: FORCE,
            };
            let exact = reference(basis, &g, omega, &rates, FORCE);
            close(&collided(forced, &g), &exact);
        }
    }
}

/// Checks that equal rates are BGK, and that one rate for even and one for odd moments are TRT.
#[test]
fn equal_rates_are_bgk_and_paired_rates_are_trt() {
    for seed in 0..20 {
        let g = cell(seed);
        for omega in [0.3, 1.1, 1.99] {
            let force = FORCE;
            let rates = Rates::two(omega, omega);
            close(
                &collided(
                    Mrt::<true> {
                        omega,
                        rates,
                        force,
                    },
                    &g,
                ),
                &collided(Bgk::<true> { omega, force }, &g),
            );
            close(
                &collided(
                    Mrt::<false> {
                        omega,
                        rates,
                        force,
                    },
                    &g,
                ),
                &collided(Bgk::<false> { omega, force }, &g),
            );
            let magic = 3.0 / 16.0;
            let rates = Rates::two(omega, antisymmetric_rate(omega, magic));
            close(
                &collided(
                    Mrt::<true> {
                        omega,
                        rates,
                        force,
                    },
                    &g,
                ),
                &collided(
                    Trt::<true> {
                        omega,
                        antisymmetric: AntisymmetricRate::Magic(magic),
                        force,
                    },
                    &g,
                ),
            );
            close(
                &collided(
                    Mrt::<false> {
                        omega,
                        rates,
                        force,
                    },
                    &g,
                ),
                &collided(
                    Trt::<false> {
                        omega,
                        antisymmetric: AntisymmetricRate::Magic(magic),
                        force,
                    },
                    &g,
                ),
            );
        }
    }
}

/// Checks that rates for single cells equal the uniform rates if the viscosity is the same.
#[test]
fn local_rates_are_those_of_the_viscosity() {
    let operator = Trt::<false> {
        omega: 1.3,
        antisymmetric: AntisymmetricRate::Magic(0.25),
        force: [0.0; 3],
    };
    let g = cell(7);
    let mut local = g;
    operator.collide::<D3Q27, f64, _, 27>(&mut local, &operator.local(1.3));
    close(&local, &collided(operator, &g));
    let (omega, force) = (1.3, FORCE);
    let equal = Trt::<true> {
        omega,
        antisymmetric: AntisymmetricRate::AsSymmetric,
        force,
    };
    let mut local = g;
    equal.collide::<D3Q27, f64, _, 27>(&mut local, &equal.local(omega));
    close(&local, &collided(Bgk::<true> { omega, force }, &g));
}
