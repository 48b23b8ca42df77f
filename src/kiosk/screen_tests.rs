//! Screens on panels of every size.

use super::*;
use crate::frame::{Channel, Plane};

/// One screen of each kind, by name.
fn examples() -> Vec<(&'static str, Screen)> {
    let text = str::to_owned;
    let photo = text("Sommer am Attersee, 1987.jpg");
    vec![
        ("ready", Screen::Ready { hint: text(DROP_AND_PRESS) }),
        (
            "waiting",
            Screen::Waiting {
                photos: 12,
                others: text("2 photos are still arriving. 1 photo will be tried again."),
            },
        ),
        ("counting", Screen::Counting { seconds: 2 }),
        ("taking", Screen::Taking),
        (
            "asking",
            Screen::Asking {
                photos: 1,
                words: text(ASK),
                others: text("1 photo is still arriving."),
            },
        ),
        ("measuring", Screen::Measuring { why: text("displaced by 0.41 px, allowed 0.25") }),
        ("working", Screen::Working { photo: photo.clone(), number: 3, of: 12 }),
        (
            "result",
            Screen::Result {
                photo,
                untouched: false,
                words: text("Photographed through the lens again, this picture is your photo."),
                hint: text(RESULT_IN_OUTBOX),
            },
        ),
        (
            "resting",
            Screen::Resting {
                words: text("The night begins at 22:00 (Europe/Vienna)."),
                photos: 4000,
                others: String::new(),
            },
        ),
        (
            "trouble",
            Screen::Trouble {
                what: text("The camera is gone: no frame came within 500 ms."),
                to_do: text("Check the camera's cable. The box tries again every minute."),
            },
        ),
        ("maintenance", Screen::Maintenance { words: text(IDLE) }),
    ]
}

fn example(name: &str) -> Screen {
    examples().into_iter().find(|(n, _)| *n == name).expect("an example").1
}

/// Share of pixels that are not the colour of the corner.
fn inked(codes: &Codes) -> f64 {
    let corner = Channel::ALL.map(|c| codes.plane(c).at(0, 0));
    let size = codes.size();
    let differs =
        |n: usize| Channel::ALL.iter().any(|&c| codes.plane(c).data()[n] != corner[c.index()]);
    (0..size.area()).filter(|&n| differs(n)).count() as f64 / size.area() as f64
}

#[test]
fn no_screen_is_black_or_like_another() {
    let size = Size::new(480, 270);
    let drawn: Vec<Codes> = examples().iter().map(|(_, screen)| draw(screen, size, None)).collect();
    for (n, codes) in drawn.iter().enumerate() {
        let brightest = Channel::ALL.map(|c| codes.plane(c).at(0, 0)).into_iter().max();
        assert!(brightest > Some(40), "{n} has a black ground");
        assert!(inked(codes) > 0.03, "{n} is empty: {}", inked(codes));
        assert!(drawn[n + 1..].iter().all(|other| other != codes), "{n} is drawn twice");
    }
}

#[test]
fn screens_fit_every_panel_with_hostile_text() {
    let hostile = "x".repeat(5000) + "\u{202e}\u{0}漢字 \n\n";
    for size in [Size::new(16, 16), Size::new(64, 480), Size::new(320, 240), Size::new(1920, 1080)]
    {
        let screen = Screen::Trouble { what: hostile.clone(), to_do: hostile.clone() };
        assert_eq!(draw(&screen, size, None).size(), size);
        let screen = Screen::Working { photo: hostile.clone(), number: 3, of: 0 };
        assert_eq!(draw(&screen, size, None).size(), size);
    }
}

#[test]
fn the_result_shows_both_pictures() {
    let (size, photo) = (Size::new(640, 360), Size::new(64, 48));
    let red: Frame<Work> = Frame::from_fn(|c| Plane::filled(photo, [255.0, 0.0, 0.0][c.index()]));
    let blue: Frame<Work> = Frame::from_fn(|c| Plane::filled(photo, [0.0, 0.0, 255.0][c.index()]));
    let codes = draw(&example("result"), size, Some(PhotoPair { before: &red, after: &blue }));
    let count = |wanted: PanelColour| {
        (0..size.area())
            .filter(|&n| {
                Channel::ALL.iter().all(|&c| codes.plane(c).data()[n] == wanted[c.index()])
            })
            .count()
    };
    let (before, after) = (count([255, 0, 0]), count([0, 0, 255]));
    assert!(before > size.area() / 4 && before.abs_diff(after) < before / 20, "{before}, {after}");
    let row = codes.plane(Channel::Red).row(20);
    assert_eq!((row[0], row[size.width - 1]), (255, 0), "the pictures reach both edges");
    assert_eq!(codes.plane(Channel::Blue).row(0)[size.width - 1], 255);
}

#[test]
fn every_example_fits_a_small_panel() {
    for (name, screen) in examples() {
        let content = content(&screen);
        let texts: Vec<&str> = content.lines.iter().map(|(text, _)| text.as_str()).collect();
        let (_, set) = lettering::fitted(&texts, 0.085 * 480.0, (700.0, 0.55 * 480.0));
        for (text, lines) in texts.iter().zip(&set) {
            assert_eq!(lines.join(" "), *text, "{name}");
        }
    }
}
