use super::{Advice, Material, MaterialError, PRESETS};

#[test]
fn every_preset_is_a_material_and_has_a_name_of_its_own() {
    assert!(PRESETS.len() >= 25);
    for (k, preset) in PRESETS.iter().enumerate() {
        preset.material.check().unwrap();
        assert_eq!(Material::preset(preset.name), Some(preset.material));
        assert!(PRESETS[..k].iter().all(|other| other.name != preset.name), "{}", preset.name);
        assert!(!preset.source.is_empty());
    }
    assert!(!PRESETS.iter().find(|p| p.name == "steel").unwrap().guess);
    assert!(PRESETS.iter().find(|p| p.name == "gelatin").unwrap().guess);
    assert_eq!(Material::preset("unobtainium"), None);
}

#[test]
fn lame_constants_give_youngs_modulus_and_poissons_ratio_back() {
    for preset in PRESETS {
        let (lambda, mu) = preset.material.lame();
        let youngs = mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu);
        let poisson = lambda / (2.0 * (lambda + mu));
        assert!((youngs / f64::from(preset.material.youngs_modulus) - 1.0).abs() < 1e-6);
        assert!((poisson - f64::from(preset.material.poisson_ratio)).abs() < 1e-6);
    }
}

#[test]
fn values_that_no_material_has_are_named() {
    let rubber = Material::preset("rubber").unwrap();
    let wrong = [
        Material { density: 0.0, ..rubber },
        Material { density: f32::NAN, ..rubber },
        Material { youngs_modulus: -1.0, ..rubber },
        Material { youngs_modulus: f32::INFINITY, ..rubber },
        Material { poisson_ratio: 0.5, ..rubber },
        Material { friction_static: -0.1, ..rubber },
        Material { friction_dynamic: 2.0, ..rubber },
        Material { restitution: 1.1, ..rubber },
        Material { damping_ratio: f32::NAN, ..rubber },
    ];
    for material in wrong {
        let MaterialError::OutOfRange { field, .. } = material.check().unwrap_err();
        assert!(material.check().unwrap_err().to_string().contains(field));
    }
}

#[test]
fn stiff_things_are_better_rigid() {
    let steel = Material::preset("steel").unwrap();
    let foam = Material::preset("foam_soft").unwrap();
    assert!(!steel.elastic() && foam.elastic());
    let Advice::Rigid(why) = steel.visible_motion(0.5, 60.0) else { panic!("steel rings") };
    assert!(why.contains("at most 30 Hz"), "{why}");
    // sqrt(2e4 / 30) / 1 = 25.8 Hz
    assert!((foam.lowest_frequency(0.5) - 25.8).abs() < 0.1);
    let Advice::Elastic(why) = foam.visible_motion(0.5, 60.0) else { panic!("foam swings slowly") };
    assert!(why.contains("26 Hz"), "{why}");
}
