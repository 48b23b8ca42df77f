//! Light and distance fitted to a photo's colours, against the shares that explain the photo best
//! given its scene.

use relens::chart::scenes::Scene;
use relens::chart::test_rig::TestPhoto;
use relens::config::{Kind, RigFile};
use relens::deconvolution::colour_focus::ColourFocus;
use relens::deconvolution::data_term::{TRUSTED, place_with_edges};
use relens::frame::{Channel, Channels, Plane};
use relens::pipeline::Pipeline;
use relens::rig::simulated;

use crate::{load, measured};

/// simulated.toml with a scene at an `offset` from the panel, dioptres.
fn rig(offset: f64) -> RigFile {
    let mut rig = load("simulated.toml");
    let Kind::Simulated(simulation) = &mut rig.kind else { panic!("a simulated rig") };
    let panel = 1000.0 / simulation.lens.object_distance_mm;
    simulation.lens.scene_distance_mm = Some(1000.0 / (panel + offset));
    rig
}

/// Shares of a photo.
struct Shares {
    fitted: ColourFocus,
    /// By least squares, given the scene.
    best: ColourFocus,
}

impl Shares {
    fn of(pipeline: &Pipeline, rig: &RigFile, scene: Scene) -> Option<Shares> {
        let (_, witness) = simulated::open(rig).unwrap();
        let light = scene.light(rig.photo.size());
        let photo = TestPhoto::taken(&witness, rig.photo.curve, &light, 70 + scene as u64);
        let prepared = photo.prepared(pipeline, Channels::Colour);
        let (observation, model) = (&prepared.observation, pipeline.model());
        let (truth, mosaic) = (witness.shaded(&light), observation.sampling.mosaic().unwrap());
        let (rect, margin) = (observation.rect, model.functions().support_px);
        let best = |of: Channel, towards: Channel| {
            let scene = place_with_edges(truth.plane(of), model.canvas(), rect);
            let [own, other] = [of, towards].map(|lens| {
                let mut seen = Plane::zeros(model.canvas());
                model.forward(lens, &scene, &mut seen);
                seen
            });
            let (data, trust) = (observation.light.plane(of), observation.trust.plane(of));
            let (mut products, mut changes) = (0.0, 0.0);
            for y in rect.y + margin..rect.y + rect.size.height - margin {
                for x in rect.x + margin..rect.x + rect.size.width - margin {
                    if mosaic.colour_at(x, y) == of && trust.at(x, y) == TRUSTED {
                        let change = f64::from(other.at(x, y) - own.at(x, y));
                        products += change * f64::from(data.at(x, y) - own.at(x, y));
                        changes += change * change;
                    }
                }
            }
            (products / changes) as f32
        };
        let [red, green, blue] = Channel::ALL;
        Some(Shares {
            fitted: ColourFocus::of(model, observation)?,
            best: ColourFocus {
                red: best(red, green),
                green: best(green, red),
                blue: best(blue, green),
            },
        })
    }
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn fitted_shares_explain_the_photo_like_the_best_ones() {
    let calibrated = rig(0.0);
    let pipeline = Pipeline::new(&calibrated, &measured(&calibrated).unwrap()).unwrap();
    for offset in [-0.013, 0.0, 0.013] {
        // The model was fitted to other scenes.
        for scene in [Scene::Rocket, Scene::Leaves] {
            let Shares { fitted, best } = Shares::of(&pipeline, &rig(offset), scene).unwrap();
            println!("{offset:+.3} dioptres, {}: {fitted:.3?}; best {best:.3?}", scene.name());
            let off = [fitted.red - best.red, fitted.green - best.green, fitted.blue - best.blue];
            // Farther away the distance is underestimated (`tests/tables/focus.md`).
            let bound = if offset < 0.0 { 0.16 } else { 0.06 };
            assert!(off.iter().all(|off| off.abs() <= bound), "{off:?}");
        }
    }
}
