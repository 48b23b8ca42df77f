//! The rig files for real boards and the blocks of hardware.md are valid.

use relens::config;

const BOARD: &str = include_str!("../../rig-config/raspberry-pi-5.toml");

fn parse(text: &str) -> Result<config::RigFile, config::ConfigError> {
    config::parse(text, "raspberry-pi-5.toml")
}

/// The board's file with its tables replaced by those of `block`.
fn with(block: &str) -> String {
    let mut whole: toml::Table = toml::from_str(BOARD).expect("it is TOML");
    let own: toml::Table = toml::from_str(block).expect("it is TOML");
    for (name, part) in own["hardware"].as_table().expect("a table of devices") {
        let devices = whole["hardware"].as_table_mut().expect("a table of devices");
        devices.insert(name.clone(), part.clone());
    }
    toml::to_string(&whole).expect("tables of plain values")
}

fn changed(from: &str, to: &str) -> String {
    assert!(BOARD.contains(from), "no {from}");
    parse(&BOARD.replacen(from, to, 1)).expect_err("such a rig file is not taken").to_string()
}

#[test]
fn the_board_s_rig_file_is_valid() {
    let rig = parse(BOARD).unwrap_or_else(|error| panic!("{error}"));
    assert!(matches!(rig.kind, config::Kind::Hardware(_)) && rig.marks.is_some());
}

#[test]
fn the_cheap_rig_s_file_is_valid_and_its_parts_cost_420_to_480() {
    let cheap = include_str!("../../rig-config/raspberry-pi-5-gs.toml");
    let rig = parse(cheap).unwrap_or_else(|error| panic!("{error}"));
    assert!(rig.mosaic().is_some() && rig.marks.is_some() && rig.warning().is_none());
    let config::Kind::Hardware(parts) = &rig.kind else { panic!("it is made of parts") };
    let config::CameraDevice::V4l2(camera) = &parts.camera else { panic!("a V4L2 camera") };
    let graph = camera.media.as_ref().expect("a media graph");
    assert!(graph.entities().any(|entity| entity == "imx296") && graph.link.len() == 1);
    // The panel is finer than the sensor along both axes, at 0.85 sensor pixels per panel pixel.
    let (panel, sensor) = (rig.panel.size(), rig.photo_grid().sensor);
    let needed = |pixels: usize| pixels as f64 / 0.85;
    assert!(
        needed(sensor.width) < panel.width as f64 && needed(sensor.height) < panel.height as f64
    );

    assert!((420.0..=480.0).contains(&total_of("### Under 500 €")));
}

/// Total in the last row of the first table after `heading`, checked against the other rows.
fn total_of(heading: &str) -> f64 {
    let page = include_str!("../../hardware.md");
    let table = page.split(heading).nth(1).expect("its section");
    let table = table.split("\n\n").find(|part| part.starts_with("| part")).expect("its table");
    let price = |row: &str| {
        let euros =
            row.split('|').find_map(|cell| cell.trim().trim_matches('*').strip_suffix(" €"));
        euros.and_then(|euros| euros.parse::<f64>().ok())
    };
    let rows: Vec<&str> =
        table.lines().skip(2).filter(|row| !row.starts_with("| the lens")).collect();
    let prices: Vec<f64> = rows.iter().copied().filter_map(price).collect();
    assert_eq!(prices.len(), rows.len(), "a price in each row: {rows:?}");
    let (total, each) = prices.split_last().expect("a total");
    assert!((total - each.iter().sum::<f64>()).abs() < 0.5, "{prices:?}");
    *total
}

#[test]
fn the_page_s_total_is_the_sum_of_its_parts() {
    assert!(total_of("## Parts") > 1000.0);
}

#[test]
fn every_block_of_the_page_is_valid() {
    let page = include_str!("../../hardware.md");
    let blocks: Vec<&str> =
        page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert_eq!(blocks.len(), 4);
    for block in blocks {
        // Grey and webcam formats have the eight bits of the board's file.
        parse(&with(block)).unwrap_or_else(|error| panic!("{error}\n{block}"));
    }
}

#[test]
fn devices_need_stable_names() {
    let link =
        "/dev/v4l/by-id/usb-The_Imaging_Source_Europe_GmbH_DFK_33UX174_00000000-video-index0";
    let said = changed(link, "/dev/video0");
    assert!(said.contains("by-id"), "{said}");
    let format = "camera.format = \"GBRG\"";
    let said = changed(format, &format!("camera.card = \"DFK 33UX174\"\n{format}"));
    assert!(said.contains("found 2 of device, card and media"), "{said}");
}

#[test]
fn the_exposure_is_a_whole_number_of_refreshes() {
    let said = changed("exposure-ms = 50.0", "exposure-ms = 45.0");
    assert!(said.contains("2.698 refreshes"), "{said}");
}

#[test]
fn a_pulse_that_sets_the_exposure_is_as_long_as_it() {
    let pulse_us = |text: &str| {
        let rig = parse(text).unwrap_or_else(|error| panic!("{error}"));
        let config::Kind::Hardware(parts) = rig.kind else { panic!("it is made of parts") };
        parts.pulse_us(rig.camera.exposure_ms)
    };
    assert_eq!(pulse_us(BOARD), 1000);
    assert_eq!(pulse_us(include_str!("../../rig-config/raspberry-pi-5-gs.toml")), 50_000);
}

#[test]
fn the_photo_takes_the_sensor_but_the_margins() {
    let rig = parse(BOARD).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((rig.photo.width_px, rig.photo.height_px), (1880, 1160));
    assert_eq!((rig.camera.photo_x_px, rig.camera.photo_y_px), (20, 20));
    assert!(BOARD.lines().count() <= 40);
}

#[test]
fn an_unknown_device_key_names_the_nearest_known_one() {
    let said = changed("button = {", "buttom = {");
    assert!(said.contains("buttom") && said.contains("`button`"), "{said}");
}
