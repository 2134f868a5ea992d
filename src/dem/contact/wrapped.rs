//! Functions that a law on top of another passes on to the law below, which is its field `law`.
//!
//! A wrapper writes the functions that it changes, and one line for all others.

/// Passes the functions of [`ContactModel`](super::ContactModel) on that no wrapper changes.
macro_rules! model_of_law_below {
    () => {
        fn materials(&self) -> u32 {
            self.law.materials()
        }

        fn friction(&self, materials: [u32; 2]) -> f64 {
            self.law.friction(materials)
        }

        fn normal_stiffness(&self, materials: [u32; 2], diameter: f64) -> f64 {
            self.law.normal_stiffness(materials, diameter)
        }

        fn growth_stiffness(&self, material: u32, diameter: f64) -> f64 {
            self.law.growth_stiffness(material, diameter)
        }

        fn springs(&self, contact: &$crate::contact::StaticContact) -> $crate::contact::Springs {
            self.law.springs(contact)
        }

        fn damping_paths(&self) -> Option<[&'static str; 2]> {
            self.law.damping_paths()
        }

        fn impact_speed(&self) -> Option<(f64, &'static str)> {
            self.law.impact_speed()
        }

        fn bonds(&self) -> bool {
            self.law.bonds()
        }

        fn bonding_gap(&self) -> f64 {
            self.law.bonding_gap()
        }

        fn bond_opening(
            &self,
            materials: [u32; 2],
            diameter: f64,
        ) -> Option<$crate::contact::BondOpening> {
            self.law.bond_opening(materials, diameter)
        }

        fn cohesion(&self, materials: [u32; 2]) -> $crate::contact::Scaled {
            self.law.cohesion(materials)
        }
    };
}

/// Passes the limits of the time step and the preparation on as well: for wrappers that change neither.
macro_rules! limits_of_law_below {
    () => {
        fn prepare(&mut self, normal_stiffness: Option<f64>, friction: Option<f64>) {
            self.law.prepare(normal_stiffness, friction);
        }

        fn time_limits(
            &self,
            material: u32,
            radii: [f64; 2],
            mass: f64,
        ) -> $crate::contact::TimeLimits {
            self.law.time_limits(material, radii, mass)
        }
    };
}

/// Passes the functions of [`ContactLaw`](super::ContactLaw) on that no wrapper changes. The argument is the field of
/// the history that is the history of the law below; none if both are the same.
macro_rules! springs_of_law_below {
    ($L:ident $(, $field:ident)?) => {
        fn bonding_gap(c: &Self::Constants) -> f64 {
            $L::bonding_gap(&c.law)
        }

        fn bond(c: &Self::Constants, history: &mut Self::History, overlap: f64) -> bool {
            $L::bond(&c.law, &mut (*history)$(.$field)?, overlap)
        }

        fn strengthen(&mut self, factor: f64) {
            $L::strengthen(&mut self.law, factor);
        }

        fn strengthen_bond(history: &mut Self::History, factor: f64) {
            $L::strengthen_bond(&mut (*history)$(.$field)?, factor);
        }

        fn shear_spring(history: &Self::History) -> S::Tangent {
            $L::shear_spring(&(*history)$(.$field)?)
        }

        fn stiffness(c: &Self::Constants) -> [f64; 2] {
            $L::stiffness(&c.law)
        }
    };
}

/// Passes bonds and normal spring on as well, with the same argument: for wrappers that have no bond of their own.
macro_rules! bonds_of_law_below {
    ($L:ident $(, $field:ident)?) => {
        #[inline(always)]
        fn bonded(history: &Self::History) -> bool {
            $L::bonded(&(*history)$(.$field)?)
        }

        #[inline(always)]
        fn holds(history: &Self::History) -> bool {
            $L::holds(&(*history)$(.$field)?)
        }

        fn bridge(history: &Self::History) -> f64 {
            $L::bridge(&(*history)$(.$field)?)
        }

        fn normal_spring(c: &Self::Constants, history: &Self::History, overlap: f64) -> f64 {
            $L::normal_spring(&c.law, &(*history)$(.$field)?, overlap)
        }

        fn tangent_stiffness(c: &Self::Constants, overlap: f64) -> f64 {
            $L::tangent_stiffness(&c.law, overlap)
        }

        fn widest_opening(&self, diameters: [f64; 2]) -> f64 {
            $L::widest_opening(&self.law, diameters)
        }
    };
}

pub(super) use {
    bonds_of_law_below, limits_of_law_below, model_of_law_below, springs_of_law_below,
};
