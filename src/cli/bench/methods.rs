//! The rows by rays per pixel: every combination of what was asked for.

use super::Arguments;
use super::ablation::without_each;
use crate::bench::Method;
use crate::scene::{BackendChoice, Estimator, SamplerKind};

impl Arguments {
    /// What to measure.
    pub(super) fn methods(&self, hardware_gpu: bool) -> Vec<Method> {
        let backends = match self.backends.as_slice() {
            [] if hardware_gpu => vec![BackendChoice::Cpu, BackendChoice::Gpu],
            [] => vec![BackendChoice::Cpu],
            given => given
                .iter()
                .map(|choice| match choice {
                    BackendChoice::Auto if hardware_gpu => BackendChoice::Gpu,
                    BackendChoice::Auto => BackendChoice::Cpu,
                    named => *named,
                })
                .collect(),
        };
        let estimators = match self.estimators.as_slice() {
            [] => vec![Estimator::Direct, Estimator::Paper],
            given => given.to_vec(),
        };
        let mut methods = Vec::new();
        for &backend in &backends {
            for &estimator in &estimators {
                let samplers = match (self.samplers.as_slice(), estimator) {
                    ([], Estimator::Direct) => vec![SamplerKind::Sobol],
                    ([], Estimator::Paper) => vec![SamplerKind::Jittered],
                    (given, _) => given.to_vec(),
                };
                for &sampler in &samplers {
                    for &composite in &self.composites {
                        let method = Method {
                            backend,
                            estimator,
                            sampler,
                            composite,
                            without: None,
                            goal: None,
                            filter: false,
                        };
                        if methods.contains(&method) {
                            continue;
                        }
                        methods.push(method);
                        if self.filter && estimator == Estimator::Direct {
                            methods.push(Method {
                                filter: true,
                                ..method
                            });
                        }
                        if estimator == Estimator::Direct {
                            methods.extend(without_each(method, &self.savings()));
                        }
                    }
                }
            }
        }
        methods
    }
}
