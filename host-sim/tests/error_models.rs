//! Error models as files: valid content, defaults, rejected content.

use host_sim::sim::ErrorModel;
use host_sim::sim::errors::BiasModel;

const WAVE: &str = r#"
    [imu]
    output = "Increments"
    gyro_range_deg_s = 1000.0
    accel_range_mps2 = 370.0
    [gyro_deg_h]
    bias = { model = "wave", initial_sigma = 1.0, interval_s = 60.0, jump_sigma = 0.1 }
    white_noise = 7.5
    [accel_mps2]
    bias = { model = "continuous", initial_sigma = 0.01 }
    [gnss]
    rate_hz = 10.0
    velocity_sigma_mps = 0.1
    horizontal_sigma_m = 1.0
    vertical_sigma_m = 1.5
    latency_s = [0.05, 0.3]
    outages = [{ start_s = 60.0, duration_s = 10.0 }]
"#;

#[test]
fn presets_round_trip_through_a_file() {
    for model in [
        ErrorModel::ideal(),
        ErrorModel::hg1700(),
        ErrorModel::mems(),
    ] {
        let text = toml::to_string(&model).unwrap();
        assert_eq!(ErrorModel::from_toml(&text).unwrap(), model);
    }
}

#[test]
fn shipped_model_is_valid() {
    let mut model = ErrorModel::from_toml(include_str!("../errors/wave.toml")).unwrap();
    assert!(matches!(model.gyro_deg_h.bias, BiasModel::Wave { .. }));
    // The preset, except for bias models and outage.
    model.gyro_deg_h.bias = BiasModel::constant(1.0);
    model.accel_mps2.bias = BiasModel::constant(0.01);
    model.gnss.outages.clear();
    assert_eq!(model, ErrorModel::hg1700());
}

#[test]
fn keys_default_to_zero() {
    let model = ErrorModel::from_toml(WAVE).unwrap();
    assert_eq!(model.accel_mps2.bias, BiasModel::constant(0.01));
    assert_eq!(model.given_heading_sigma_deg, None);
}

#[test]
fn single_keys_are_set_and_checked() {
    let with = |text: &str| ErrorModel::mems().with(&text.parse().unwrap());
    let correlated = "gnss.habits.velocity = { sigma = 0.05, time_s = 1.0 }";
    let set = with(&format!("gyro_deg_h.scale_sigma = 0.001\n{correlated}")).unwrap();
    let mut expected = ErrorModel::mems();
    expected.gyro_deg_h.scale_sigma = 0.001;
    expected.gnss.habits.velocity.sigma = 0.05;
    assert_eq!(set, expected);
    let wave = "model = \"wave\", initial_sigma = 9.0, interval_s = 5.0, jump_sigma = 1.0";
    let set = with(&format!("gyro_deg_h.bias = {{ {wave} }}")).unwrap();
    assert!(matches!(set.gyro_deg_h.bias, BiasModel::Wave { .. }));
    for (text, message) in [
        (
            "gnss.rate_hz = -1.0",
            "gnss.rate_hz = -1: expected more than zero",
        ),
        ("gyro.scale_sigma = 0.1", "unknown field `gyro`"),
    ] {
        let error = with(text).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn signed_errors_may_be_negative() {
    let offset = "off = { velocity_mps = [-0.1, 0.0, 0.0], position_m = [0.0, -5.0, 0.0] }";
    let trouble = format!("{{ start_s = 9.0, duration_s = 1.0, wrong = {{ {offset} }} }}");
    let keys = format!(
        "gnss.habits = {{ clock_drift = -1e-4, lever_arm_m = [-1.0, 0.0, 2.0], troubles = [{trouble}] }}"
    );
    let model = ErrorModel::mems().with(&keys.parse().unwrap()).unwrap();
    assert_eq!(model.gnss.habits.troubles.len(), 1);
}

#[test]
fn time_stamp_jitter_is_limited_by_the_sampling_rate() {
    let mut model = ErrorModel::hg1700();
    model.imu.stamp_jitter_s = 0.0045;
    model.check_at(100.0).unwrap();
    let error = model.check_at(200.0).unwrap_err().to_string();
    let message = "imu.stamp_jitter_s = 0.0045: expected at most 0.49 of the time";
    assert!(error.starts_with(message), "{error}");
}

#[test]
fn invalid_files_are_rejected_with_a_message() {
    for (good, bad, message) in [
        (
            "rate_hz = 10.0",
            "rate_hz = 0.0",
            "gnss.rate_hz = 0: expected more than zero",
        ),
        ("rate_hz = 10.0", "rate_hz = nan", "gnss.rate_hz = NaN"),
        (
            "rate_hz = 10.0",
            "rate_hz = 1e9",
            "gnss.rate_hz = 1000000000: expected 1000 at most",
        ),
        (
            "interval_s = 60.0",
            "interval_s = -1.0",
            "gyro_deg_h.bias.interval_s = -1",
        ),
        (
            "[0.05, 0.3]",
            "[0.3, 0.05]",
            "gnss.latency_s[1] = 0.05: expected no less",
        ),
        (
            "[0.05, 0.3]",
            "[50, 300]",
            "gnss.latency_s[0] = 50: expected 10 s at most",
        ),
        (
            "white_noise = 7.5",
            "white_noise = -7.5",
            "gyro_deg_h.white_noise = -7.5",
        ),
        (
            "white_noise = 7.5",
            "whit_noise = 7.5",
            "unknown field `whit_noise`",
        ),
        (
            "[gnss]",
            "[gnss]\nhabits.clock_drift = 1.0",
            "gnss.habits.clock_drift = 1: expected s/s, 0.01 at most",
        ),
        (
            "[gnss]",
            "[gnss]\nhabits.clock_drift = nan",
            "gnss.habits.clock_drift = NaN",
        ),
        (
            "[gnss]",
            "[gnss]\nhabits.delay_s = [0.0, inf]",
            "gnss.habits.delay_s[1] = inf",
        ),
        (
            "[gnss]",
            "[gnss]\nhabits.lever_arm_m = [0.0, 3e3, 0.0]",
            "gnss.habits.lever_arm_m[1] = 3000: expected 100 m at most",
        ),
        (
            "[gnss]",
            "[gnss]\nhabits.outliers = { fraction = 0.1, velocity_mps = -1.0, position_m = 0.0 }",
            "gnss.habits.outliers.velocity_mps = -1",
        ),
        (
            "[gnss]",
            "[gnss]\nhabits.troubles = [{ start_s = 9.0, duration_s = -1.0, wrong = \"stuck\" }]",
            "gnss.habits.troubles.duration_s = -1",
        ),
        (
            "[gnss]",
            "[gnss]\nhabits.troubles = [{ start_s = 9.0, duration_s = 1.0, wrong = { float = [0.0, nan, 0.0] } }]",
            "gnss.habits.troubles.wrong.float[1] = NaN: expected a number",
        ),
        ("\"wave\"", "\"waves\"", "unknown variant `waves`"),
        ("= 7.5", "= ", "line 8"),
    ] {
        assert!(WAVE.contains(good));
        let error = ErrorModel::from_toml(&WAVE.replace(good, bad))
            .unwrap_err()
            .to_string();
        assert!(error.contains(message), "{bad}: {error}");
    }
}
