//! Distances of panel and camera in the pages and drawings, checked with the thin-lens formula.

/// Millimetres per inch.
const INCH_MM: f64 = 25.4;

/// Width and height in pixels.
#[derive(Clone, Copy)]
struct Size {
    width: usize,
    height: usize,
}

impl Size {
    const fn new(width: usize, height: usize) -> Size {
        Size { width, height }
    }
}

/// The parts of a rig: focal length, diagonal and pixels of the panel, side and number of the
/// sensor's pixels.
struct Plan {
    lens_mm: f64,
    panel_inches: f64,
    panel: Size,
    pixel_um: f64,
    sensor: Size,
}

/// Distances for one magnification.
#[derive(Debug)]
struct Distances {
    /// From the lens's middle to the panel.
    panel_mm: f64,
    /// From the lens's middle to the sensor.
    sensor_mm: f64,
    /// Whether the panel fills the sensor's view.
    covers: bool,
}

impl Plan {
    /// The distances for `magnification` sensor pixels per panel pixel.
    fn at(&self, magnification: f64) -> Distances {
        let Size { width, height } = self.panel;
        let diagonal_px = (width as f64).hypot(height as f64);
        let pitch_mm = self.panel_inches * INCH_MM / diagonal_px;
        let scale = magnification * self.pixel_um / 1000.0 / pitch_mm;
        let seen = |pixels: usize| pixels as f64 / magnification;
        let Size { width: across, height: down } = self.sensor;
        Distances {
            panel_mm: self.lens_mm * (1.0 + 1.0 / scale),
            sensor_mm: self.lens_mm * (1.0 + scale),
            covers: seen(across) <= width as f64 && seen(down) <= height as f64,
        }
    }
}

const SENSORS: [(&str, f64, Size); 2] =
    [("IMX174", 5.86, Size::new(1920, 1200)), ("IMX296", 3.45, Size::new(1456, 1088))];

#[test]
fn a_lens_at_twice_its_focal_length_images_at_unit_magnification() {
    let panel = Size::new(3000, 4000);
    let plan = Plan {
        lens_mm: 50.0,
        // 5000 pixels of 10 µm.
        panel_inches: 50.0 / INCH_MM,
        panel,
        pixel_um: 10.0,
        sensor: Size::new(3000, 4001),
    };
    let there = plan.at(1.0);
    assert!((there.panel_mm - 100.0).abs() < 1e-9 && (there.sensor_mm - 100.0).abs() < 1e-9);
    assert!(!there.covers && plan.at(1.01).covers);
}

#[test]
fn distances_in_hardware_md_equal_the_computed_ones() {
    let page = include_str!("../../hardware.md");
    let table = page.split("| sensor | panel | 16 mm").nth(1).expect("the table of distances");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let mut checked = 0;
    for row in rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let (_, pixel_um, sensor) =
            SENSORS.into_iter().find(|(name, ..)| cells[1].contains(name)).expect("a sensor");
        let (inches, pixels) = cells[2].split_once(" inch, ").expect("a panel");
        let (width, height) = pixels.split_once('×').expect("its pixels");
        let panel = Size::new(width.parse().unwrap(), height.parse().unwrap());
        for (lens_mm, cell) in [16.0, 25.0, 35.0, 50.0, 75.0].into_iter().zip(&cells[3..]) {
            let panel_inches = inches.parse().unwrap();
            let plan = Plan { lens_mm, panel_inches, panel, pixel_um, sensor };
            let wanted = plan.at(0.85);
            assert_eq!(*cell, format!("{:.2} m", wanted.panel_mm / 1000.0), "{row}");
            assert!(wanted.covers, "{row}");
            checked += 1;
        }
    }
    assert_eq!(checked, 20);
}

#[test]
fn the_drawings_are_to_scale() {
    let drawings = [
        include_str!("../../tests/pictures/dock.svg"),
        include_str!("../../tests/pictures/window.svg"),
    ];
    let (_, pixel_um, sensor) = SENSORS[0];
    let panel = Size::new(2560, 1440);
    let plan = Plan { lens_mm: 25.0, panel_inches: 27.0, panel, pixel_um, sensor };
    let wanted = plan.at(0.85);
    // Start and length of the line `id`, which is horizontal or vertical.
    let line = |drawing: &str, id: &str| -> ([f64; 2], f64) {
        let (_, rest) = drawing.split_once(&format!("<path id=\"{id}\" d=\"M")).expect(id);
        let (path, _) = rest.split_once('"').expect("its end");
        let numbers: Vec<f64> =
            path.split([' ', 'V', 'H']).filter_map(|n| n.parse().ok()).collect();
        let along =
            if path.contains('V') { numbers[2] - numbers[1] } else { numbers[2] - numbers[0] };
        ([numbers[0], numbers[1]], along)
    };
    for (drawing, axis, side) in [(drawings[0], 0, 1440.0), (drawings[1], 1, 2560.0)] {
        let (panel_at, long) = line(drawing, "panel-front");
        let (lens_at, _) = line(drawing, "lens-middle");
        let far = (panel_at[axis] - lens_at[axis]).abs();
        assert!((far - wanted.panel_mm).abs() < 1.0, "{far}, wanted {wanted:?}");
        let diagonal = 2560f64.hypot(1440.0);
        assert!((long - side / diagonal * 27.0 * INCH_MM).abs() < 1.0, "{long}");
        assert!(drawing.contains(&format!("{:.0} mm from the panel", wanted.panel_mm)));
    }
}

#[test]
fn adapters_in_hardware_md_fill_the_flange_distances() {
    let page = include_str!("../../hardware.md");
    let table = page.split("| lens with | flange").nth(1).expect("the table of mounts");
    let mut checked = 0;
    for row in table.lines().skip(2).take_while(|line| line.starts_with('|')) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let mm = |cell: &str| cell.split_once(" mm").and_then(|(n, _)| n.parse::<f64>().ok());
        if let (Some(flange), Some(adapter)) = (mm(cells[2]), mm(cells[3])) {
            assert!((flange - 17.526 - adapter).abs() < 0.006, "{row}");
            checked += 1;
        }
    }
    assert_eq!(checked, 4);
    let (_, pixel_um, sensor) = SENSORS[0];
    let panel = Size::new(2560, 1440);
    let plan = Plan { lens_mm: 25.0, panel_inches: 27.0, panel, pixel_um, sensor };
    let farther = format!("{:.2} mm for 25 mm at 1.2 m", plan.at(0.85).sensor_mm - 25.0);
    assert!(page.contains(&farther), "{farther}");
}
