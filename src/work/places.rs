//! Where a frame's time goes on the host: each piece of its work is booked at one place.

use std::sync::Arc;
use std::time::Instant;

use crate::clock::HostThreads;

/// What the host does for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Exposure and albedo from the photograph.
    Photo,
    /// Packing, and acceleration structures.
    Trees,
    /// What virtual objects show of the photograph.
    Backdrop,
    Pilot,
    /// An empty film.
    Film,
    /// The scene's records to the device.
    Upload,
    /// Kernels composed and compiled.
    Kernels,
    /// Which samples are taken.
    List,
    /// Commands to the device: recorded and submitted.
    Record,
    /// The device is waited for.
    Wait,
    /// Sums between film and device.
    Sums,
    /// Photons, but for what the device does.
    Photons,
    /// Sums to the picture.
    Composite,
}

impl Place {
    pub const ALL: [Self; 13] = [
        Self::Photo,
        Self::Trees,
        Self::Backdrop,
        Self::Pilot,
        Self::Film,
        Self::Upload,
        Self::Kernels,
        Self::List,
        Self::Record,
        Self::Wait,
        Self::Sums,
        Self::Photons,
        Self::Composite,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Photo => "photo",
            Self::Trees => "trees",
            Self::Backdrop => "backdrop",
            Self::Pilot => "pilot",
            Self::Film => "film",
            Self::Upload => "upload",
            Self::Kernels => "kernels",
            Self::List => "list",
            Self::Record => "record",
            Self::Wait => "wait",
            Self::Sums => "sums",
            Self::Photons => "photons",
            Self::Composite => "composite",
        }
    }
}

/// Seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// On the clock.
    pub wall: f64,
    /// Of the processors, in the host's threads; 0 unless they are counted.
    pub cpu: f64,
}

impl std::ops::AddAssign for Spent {
    fn add_assign(&mut self, other: Self) {
        self.wall += other.wall;
        self.cpu += other.cpu;
    }
}

/// What was spent at each place.
#[derive(Clone, Debug, Default)]
pub struct Places {
    spent: [Spent; Place::ALL.len()],
    threads: Option<Arc<HostThreads>>,
}

/// When a piece of work began.
#[derive(Clone, Copy, Debug)]
pub struct Begun {
    at: Instant,
    cpu_secs: f64,
}

impl Places {
    /// Empty, and counting processor time from now on.
    pub(crate) fn counting(threads: Option<Arc<HostThreads>>) -> Self {
        Self {
            threads,
            ..Self::default()
        }
    }

    pub fn begin(&self) -> Begun {
        Begun {
            cpu_secs: self.cpu_secs(),
            at: Instant::now(),
        }
    }

    /// Books what was spent since then; the next piece of work begins.
    pub fn end(&mut self, place: Place, begun: Begun) -> Begun {
        let now = self.begin();
        self.spent[place as usize] += Spent {
            wall: (now.at - begun.at).as_secs_f64(),
            cpu: now.cpu_secs - begun.cpu_secs,
        };
        now
    }

    pub fn of(&self, place: Place) -> Spent {
        self.spent[place as usize]
    }

    pub fn sum(&self) -> Spent {
        let mut sum = Spent::default();
        self.spent.iter().for_each(|&spent| sum += spent);
        sum
    }

    /// Also what was booked there.
    pub fn add(&mut self, other: &Self) {
        for (sum, &spent) in self.spent.iter_mut().zip(&other.spent) {
            *sum += spent;
        }
    }

    fn cpu_secs(&self) -> f64 {
        self.threads.as_ref().map_or(0.0, |threads| threads.secs())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn each_place_keeps_its_own_account() {
        assert!(
            (Place::ALL.iter().enumerate()).all(|(at, &place)| at == place as usize),
            "the order of the declaration"
        );
        let mut places = Places::counting(HostThreads::here().map(Arc::new));
        let begun = places.begin();
        std::thread::sleep(Duration::from_millis(2));
        places.end(Place::Wait, begun);
        assert!(places.of(Place::Wait).wall >= 0.002);
        assert_eq!(places.of(Place::Pilot), Spent::default(), "control");
        let mut twice = places.clone();
        twice.add(&places);
        assert_eq!(twice.sum().wall, 2.0 * places.of(Place::Wait).wall);
    }
}
