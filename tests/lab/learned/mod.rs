//! A learned prior, compared with shrinkage and block matching. It is a method of the laboratory
//! only, because it restores worse than block matching (`tests/tables/tried.md`).
//!
//! Half-quadratic splitting, as in block matching: a data step by the lens's local inverse
//! alternates with a pass of the network. A JPEG's data are its decoded pixels, not its
//! coefficients.

mod denoiser;
mod network;
pub(crate) mod rows;

use relens::deconvolution::data_term::{NOISE_MIN, residual_in_place};
use relens::deconvolution::forward_convolution::ForwardConvolution;
use relens::deconvolution::method::blocks::TAU_MAX;
use relens::deconvolution::method::digital::Digital;
use relens::deconvolution::method::{
    About, Certificate, Method, MethodError, Problem, Solution, Watch,
};
use relens::frame::{Channel, FULL_SCALE};

use denoiser::denoise;
use network::Network;

/// Weights of the network, trained by `prior/train.py`.
const WEIGHTS: &[u8] = include_bytes!("../prior/weights.bin");

/// The method's properties.
const ABOUT: About = About { name: "learned", starts_from_lens: true };

/// Rounds of data step and network after a solve with the lens model.
pub(crate) struct Learned {
    digital: Digital,
    network: Network,
    rounds: Rounds,
}

/// The rounds' parameters.
#[derive(Clone, Copy)]
pub(crate) struct Rounds {
    /// Steps with the lens model before the rounds.
    pub(crate) steps: u32,
    /// Number of rounds, at least 1.
    pub(crate) count: u32,
    /// Standard deviation τ of the data step's prior in the first and the last round, in units of
    /// the photo's noise σ.
    pub(crate) over_noise: [f32; 2],
    /// Noise that the network assumes, in units of τ.
    pub(crate) assumed: f32,
}

impl Learned {
    /// The method with the stored weights.
    pub(crate) fn new(rounds: Rounds) -> Learned {
        let network = Network::parse(WEIGHTS).expect("the file has all weights");
        let digital = Digital { steps: rounds.steps, ..Digital::default() };
        Learned { digital, network, rounds }
    }
}

impl Method for Learned {
    fn about(&self) -> &'static About {
        &ABOUT
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let start = self.digital.solve(problem, optics, watch)?;
        let (observation, mut picture) = (problem.observation, start.picture);
        let Rounds { count, over_noise: [first, last], assumed, .. } = self.rounds;
        for round in 0..count {
            let done = round as f32 / (count - 1).max(1) as f32;
            let over_noise = first * (last / first).powf(done);
            let noise = |c: Channel| observation.pixel_noise(c).max(NOISE_MIN);
            let tau = |c: Channel| (noise(c) * over_noise).min(TAU_MAX);
            let ratio = |c: Channel| observation.pixels_a_datum(c) * (noise(c) / tau(c)).powi(2);
            let mut seen = problem.predict(&picture);
            let mut planes = Channel::ALL.map(|c| {
                let mut residual = std::mem::take(seen.plane_mut(c));
                let (light, trust) = (observation.light.plane(c), observation.trust.plane(c));
                residual_in_place(&mut residual, light, trust);
                problem.data_step(c, picture.plane(c), residual, ratio(c))
            });
            let sigma = Channel::ALL.map(|c| assumed * tau(c));
            let round = round as usize;
            denoise(&self.network, &mut planes, sigma, [round % 2, round / 2 % 2]);
            for (c, mut plane) in Channel::ALL.into_iter().zip(planes) {
                plane.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
                *picture.plane_mut(c) = plane;
            }
        }
        let prediction = Some(problem.predict(&picture));
        let certificate = Certificate::uncertified(problem);
        Ok(Solution { prediction, ..Solution::of(picture, start.record, certificate) })
    }
}
