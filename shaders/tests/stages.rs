//! Every stage parses and validates with every set of switches it is used with, and says what Rust says; without a device.

use naga::valid::{Capabilities, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator};
use splat_shaders::layouts::LAYOUTS;
use splat_shaders::{STAGES, variant};

fn parse(text: &str) -> naga::Module {
    naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)))
}

/// Every stage with every set of switches.
fn modules() -> Vec<(String, naga::Module)> {
    let mut all = Vec::new();
    for stage in STAGES {
        assert!(!stage.variants.is_empty(), "{} has no variant", stage.name);
        for switches in stage.variants {
            all.push((format!("{} {switches:?}", stage.name), parse(&variant(stage, switches))));
        }
    }
    all
}

#[test]
fn every_stage_validates_with_every_set_of_switches() {
    for (name, module) in modules() {
        // pack2x16float: every device but some of OpenGL's.
        let mut capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        if name.contains("SUBGROUPS") {
            capabilities |= Capabilities::SUBGROUP;
        }
        let mut validator = Validator::new(ValidationFlags::all(), capabilities);
        validator.subgroup_stages(ShaderStages::COMPUTE).subgroup_operations(SubgroupOperationSet::all());
        if let Err(e) = validator.validate(&module) {
            panic!("{name}: {e:?}");
        }
        assert!(!module.entry_points.is_empty(), "{name} has no kernel");
        println!("{name}: {} kernels", module.entry_points.len());
    }
}

/// WebGPU's least `maxComputeWorkgroupStorageSize`.
const WORKGROUP_MEMORY: u32 = 16 << 10;

#[test]
fn no_kernel_has_more_workgroup_memory_than_every_device() {
    for (name, module) in modules() {
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).expect("types have a layout");
        // Each kernel's module has its own memory and little else's: all of it is counted.
        let bytes: u32 = module
            .global_variables
            .iter()
            .filter(|(_, variable)| variable.space == naga::AddressSpace::WorkGroup)
            .map(|(_, variable)| layouter[variable.ty].size.next_multiple_of(16))
            .sum();
        assert!(bytes <= WORKGROUP_MEMORY, "{name}: {bytes} bytes of workgroup memory, {WORKGROUP_MEMORY} is sure");
    }
}

#[test]
fn shaders_read_every_structure_where_rust_writes_it() {
    for layout in LAYOUTS {
        let stage = STAGES.iter().find(|s| s.name == layout.stage).expect("a stage");
        for switches in stage.variants {
            let module = parse(&variant(stage, switches));
            let (_, read) = (module.types.iter().find(|(_, t)| t.name.as_deref() == Some(layout.name)))
                .unwrap_or_else(|| panic!("{} declares no {}", layout.stage, layout.name));
            let naga::TypeInner::Struct { members, span } = &read.inner else { panic!("{} is none", layout.name) };
            let fields: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
            assert_eq!(fields, layout.fields, "{}", layout.name);
            assert_eq!(*span as usize, layout.size, "{}", layout.name);
        }
    }
}
