//! Reports as displayed and printed by a browser. Needs Chromium and poppler: `.ci/install`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// Largest report of an hour of log.
const LARGEST_BYTES: u64 = 6_000_000;

/// A page that shows the report in a frame of a given width, and reports layout defects.
const PROBE: &str = r#"<!doctype html><body><pre id="found"></pre><iframe id="frame"></iframe><script>
const { src, width } = JSON.parse(decodeURIComponent(location.hash.slice(1)));
frame.style = `width: ${width}px; height: 900px; border: 0`;
frame.src = src;
const pause = ms => new Promise(done => setTimeout(done, ms));

function texts(page) {
  const walker = page.createTreeWalker(page.body, NodeFilter.SHOW_TEXT);
  const range = page.createRange();
  const seen = [];
  while (walker.nextNode()) {
    const node = walker.currentNode, element = node.parentElement;
    if (!node.data.trim() || element.closest("script, style, noscript")) continue;
    const style = frame.contentWindow.getComputedStyle(element);
    if (style.visibility === "hidden" || style.opacity === "0") continue;
    range.selectNodeContents(node);
    const drawn = element instanceof frame.contentWindow.SVGElement;
    const colour = drawn ? style.fill : style.color;
    for (const box of drawn ? [element.getBoundingClientRect()] : range.getClientRects()) {
      if (box.width && box.height) seen.push({ text: node.data.trim(), box, colour, plot: element.closest(".plot") });
    }
  }
  return seen;
}

function overlaps(seen) {
  const found = [];
  seen.forEach((one, index) => seen.slice(index + 1).forEach(other => {
    const wide = Math.min(one.box.right, other.box.right) - Math.max(one.box.left, other.box.left);
    const high = Math.min(one.box.bottom, other.box.bottom) - Math.max(one.box.top, other.box.top);
    // Line boxes are higher than letters.
    if (wide > 1 && high > 0.35 * Math.min(one.box.height, other.box.height))
      found.push(`${one.text} | ${other.text}`);
  }));
  return found;
}

// Contrast of WCAG 2.
function luminance(colour) {
  const parts = colour.match(/[\d.]+/g).slice(0, 3).map(part => part / 255);
  const [red, green, blue] = parts.map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}
function contrast(a, b) {
  const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
}

frame.onload = async () => {
  const view = frame.contentWindow, page = frame.contentDocument;
  while (!page.body.dataset.drawn) await pause(20);
  await pause(200);
  const plots = [...page.querySelectorAll(".plot")];
  const paper = view.getComputedStyle(page.body).backgroundColor;
  const over_time = [...page.querySelectorAll(".plot[data-time]")];
  const seen = texts(page);
  const empty = plots.filter(plot => ![...plot.querySelectorAll(".scatterlayer path")]
    .some(path => path.getAttribute("d")?.length > 5));
  const caption = plot => plot.parentElement.querySelector("figcaption").firstChild.data;
  const result = {
    plots: plots.length,
    over_time: over_time.length,
    empty: empty.map(caption),
    overlapping: overlaps(seen),
    pale: seen.filter(one => contrast(one.colour, paper) < 4).map(one => one.text),
    too_wide: page.documentElement.scrollWidth - width,
    outside: seen.filter(one => one.plot && one.box.right > width + 1).map(one => one.text),
    loaded: view.performance.getEntriesByType("resource").map(entry => entry.name),
    dark: luminance(paper) < 0.2,
    velocity_notes: [...page.querySelectorAll("figcaption")].map(one => one.innerText)
      .filter(text => text.startsWith("Velocity, ") && text.includes("RMS")),
    captions: over_time.map(plot => {
      const [title, note] = plot.parentElement.querySelector("figcaption").childNodes;
      return { text: note ? `${title.data} ${note.textContent.split(" ")[0]}` : title.data, whole: !note };
    }),
  };
  if (over_time.length > 0) {
    await view.Plotly.relayout(over_time[0], { "xaxis.range": [100, 200] });
    await pause(200);
    result.zoomed = over_time.filter(plot => plot.layout.xaxis.range[1] === 200).length;
  }
  found.textContent = JSON.stringify(result);
};
</script>"#;

fn host_sim(home: &Path, arguments: &[&str]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let output = command.current_dir(home).args(arguments).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {stderr}");
}

/// Chromium with a page; messages of scripts are on standard error.
fn chromium(arguments: &[&str], address: &str) -> Output {
    let profile = tempfile::tempdir().unwrap();
    let mut command = Command::new("chromium");
    command.args([
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
    ]);
    // Virtual time: it only waits for scripts.
    command.args([
        "--virtual-time-budget=120000",
        "--allow-file-access-from-files",
    ]);
    command.arg(format!("--user-data-dir={}", profile.path().display()));
    let output = command.args(arguments).arg(address).output();
    output.expect("chromium is missing: run .ci/install")
}

/// Result of the probe for a report of a width.
fn probe_report(report: &Path, width: u32, dark: bool) -> Value {
    let probe = report.with_file_name("probe.html");
    fs::write(&probe, PROBE).unwrap();
    let hash = format!("{{%22src%22:%22report.html%22,%22width%22:{width}}}");
    let address = format!("file://{}#{hash}", probe.display());
    let scheme = format!("--blink-settings=preferredColorScheme={}", u8::from(!dark));
    let output = chromium(
        &["--window-size=1500,1000", "--dump-dom", &scheme],
        &address,
    );
    let stderr = String::from_utf8_lossy(&output.stderr);
    for defect in ["Uncaught", "Refused", "CONSOLE"] {
        assert!(!stderr.contains(defect), "{stderr}");
    }
    let page = String::from_utf8(output.stdout).unwrap();
    let json = page.split_once("<pre id=\"found\">").unwrap().1;
    let json = json.split_once("</pre>").unwrap().0;
    let json = json
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    serde_json::from_str(&json).unwrap_or_else(|_| panic!("nothing was drawn: {stderr}"))
}

fn check_report(report: &Path) -> Value {
    let mut last = Value::Null;
    for (width, dark) in [(1366, false), (390, false), (390, true)] {
        let result = probe_report(report, width, dark);
        let case = format!("{width} px, dark {dark}: {result:#}");
        for what in ["empty", "overlapping", "pale", "outside", "loaded"] {
            assert_eq!(result[what], Value::Array(Vec::new()), "{what} at {case}");
        }
        assert!(result["too_wide"].as_i64().unwrap() <= 0, "{case}");
        assert_eq!(result["dark"], dark, "{case}");
        if result["over_time"] != 0 {
            assert_eq!(result["zoomed"], result["over_time"], "{case}");
        }
        last = result;
    }
    last
}

/// Text of each page as printed on A4.
fn printed_pages(report: &Path) -> Vec<String> {
    let [pdf, text] = ["print.pdf", "print.txt"].map(|name| report.with_file_name(name));
    let to_pdf = format!("--print-to-pdf={}", pdf.display());
    let address = format!("file://{}", report.display());
    chromium(&["--no-pdf-header-footer", &to_pdf], &address);
    let mut command = Command::new("pdftotext");
    let done = command.args([&pdf, &text]).status();
    assert!(
        done.expect("pdftotext is missing: run .ci/install")
            .success()
    );
    let text = fs::read_to_string(&text).unwrap();
    text.split('\u{c}').map(str::to_owned).collect()
}

fn log_and_report(home: &Path, minutes: &str) -> PathBuf {
    host_sim(
        home,
        &[
            "drive",
            "--minutes",
            minutes,
            "--grade",
            "mems",
            "--out",
            "log",
        ],
    );
    host_sim(home, &["identify", "log", "--out", "report"]);
    home.join("report/report.html")
}

#[test]
fn report_of_an_hour_is_displayed_and_printed_completely() {
    let home = tempfile::tempdir().unwrap();
    let report = log_and_report(home.path(), "60");
    let size = fs::metadata(&report).unwrap().len();
    assert!(size < LARGEST_BYTES, "{size}");
    let result = check_report(&report);
    assert!(result["plots"].as_u64().unwrap() > 30, "{result:#}");
    // Innovations are consistent with the configured receiver noise.
    let notes = result["velocity_notes"].as_array().unwrap();
    assert_eq!(notes.len(), 3);
    for note in notes {
        let ratio = note.as_str().unwrap().rsplit(' ').next().unwrap();
        assert!(
            (0.8..1.25).contains(&ratio.parse::<f64>().unwrap()),
            "{note}"
        );
    }

    // Each caption is on the page of its plot, which ends with its x axis label.
    let pages = printed_pages(&report);
    let captions = result["captions"].as_array().unwrap();
    let is_caption = |line: &str| {
        captions.iter().any(|caption| {
            let text = caption["text"].as_str().unwrap();
            // A note of one or more lines follows.
            line == text || caption["whole"] == false && line.starts_with(text)
        })
    };
    let mut found = 0;
    for page in pages.iter().filter(|page| page.contains("time, s")) {
        let lines = || page.lines().map(str::trim);
        let plots = lines().filter(|line| *line == "time, s").count();
        let captions_on_page = lines().filter(|line| is_caption(line)).count();
        assert_eq!(captions_on_page, plots, "{page}");
        found += plots;
    }
    assert_eq!(found, captions.len());
}

#[test]
fn several_logs_are_shown_side_by_side() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    for (seed, log) in [("1", "a"), ("2", "b")] {
        host_sim(
            home,
            &[
                "drive",
                "--minutes",
                "8",
                "--grade",
                "mems",
                "--seed",
                seed,
                "--out",
                log,
            ],
        );
    }
    host_sim(home, &["identify", "a", "b", "--out", "both"]);
    let page = fs::read_to_string(home.join("both/report.html")).unwrap();
    for text in [
        "Estimates side by side",
        "simulated drive, seed 1",
        "simulated drive, seed 2",
    ] {
        assert!(page.contains(text), "{text}");
    }
    // Two units with different biases.
    assert!(page.contains("the logs differ by more than their sigmas allow"));
    check_report(&home.join("both/report.html"));
}
