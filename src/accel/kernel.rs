//! Which instructions the CPU's traversal is made of.

#[cfg(target_arch = "x86_64")]
use super::avx2;
use super::trace::{self, Found};
use super::wide::WideBvh;
use super::{Hit, Ray};

/// Which instructions the traversal uses; the results are the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kernel {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Kernel {
    /// All there are, the slowest first.
    const ALL: &[Kernel] = &[
        Kernel::Portable,
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx2,
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx512,
    ];

    /// Those that this processor can run, the slowest first.
    pub(super) fn supported() -> impl DoubleEndedIterator<Item = Kernel> {
        Kernel::ALL.iter().copied().filter(|kernel| match kernel {
            Kernel::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => avx2::has_avx2(),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx512 => avx2::has_avx512(),
        })
    }

    /// The fastest that this processor can run.
    pub(super) fn best() -> Kernel {
        Kernel::supported().next_back().unwrap_or(Kernel::Portable)
    }
}

#[inline(always)]
fn traverse<const ANY: bool>(tree: &WideBvh, kernel: Kernel, ray: &Ray) -> Found {
    match kernel {
        Kernel::Portable => trace::traverse::<ANY>(tree, ray),
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx2 => avx2::traverse::<ANY>(tree, ray),
        #[cfg(target_arch = "x86_64")]
        Kernel::Avx512 => avx2::traverse_avx512::<ANY>(tree, ray),
    }
}

#[inline(always)]
pub(super) fn closest(tree: &WideBvh, kernel: Kernel, ray: &Ray) -> Hit {
    let found = traverse::<false>(tree, kernel, ray);
    if !found.any {
        return Hit::MISS;
    }
    Hit {
        t: found.t,
        u: found.weights[0],
        v: found.weights[1],
        triangle: found.id,
    }
}

#[inline(always)]
pub(super) fn any(tree: &WideBvh, kernel: Kernel, ray: &Ray) -> bool {
    traverse::<true>(tree, kernel, ray).any
}
