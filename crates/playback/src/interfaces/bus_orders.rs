//! Which of the buses each interface is, where every order of them is tried.

/// Most buses whose orders are all tried.
const MOST_BUSES: usize = 8;

/// The orders of buses for interfaces that fit best.
#[derive(Default)]
pub(crate) struct Orders {
    misfit: Option<usize>,
    best: Vec<Vec<usize>>,
}

impl Orders {
    /// Of the buses for these interfaces, where `misfit` is what speaks against an interface as a bus. None where there are too
    /// many, or fewer buses than interfaces.
    pub(crate) fn of(interfaces: &[usize], buses: &[usize], misfit: &dyn Fn(usize, usize) -> usize) -> Self {
        let mut orders = Self::default();
        if buses.len() <= MOST_BUSES && interfaces.len() <= buses.len() {
            orders.try_all(interfaces, buses, &mut Vec::new(), 0, misfit);
        }
        orders
    }

    /// Tries every order of so many of the buses as there are interfaces left, and keeps those against which the least speaks.
    fn try_all(
        &mut self,
        interfaces: &[usize],
        buses: &[usize],
        taken: &mut Vec<usize>,
        so_far: usize,
        misfit: &dyn Fn(usize, usize) -> usize,
    ) {
        if self.misfit.is_some_and(|best| so_far > best) {
            return;
        }
        let Some(interface) = interfaces.get(taken.len()) else {
            if self.misfit.is_none_or(|best| so_far < best) {
                (self.misfit, self.best) = (Some(so_far), Vec::new());
            }
            self.best.push(taken.clone());
            return;
        };
        for bus in buses {
            if !taken.contains(bus) {
                taken.push(*bus);
                self.try_all(
                    interfaces,
                    buses,
                    taken,
                    so_far + misfit(*interface, *bus),
                    misfit,
                );
                taken.pop();
            }
        }
    }

    /// The best order, if no other is as good.
    pub(crate) fn only(&self) -> Option<&[usize]> {
        match &self.best[..] {
            [only] => Some(only),
            _ => None,
        }
    }
}
