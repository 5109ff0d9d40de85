// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise capture: records the streams of a rig in sync: tracker, force, camera.
 */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/capture.h>
#include <incise/prove.h>
#include <incise/rig.h>
#include "capture/capture.h"
#include "cli/calibration.h"
#include "cli/cli.h"
#include "cli/recording.h"

enum camera { CAMERA_AUTO, CAMERA_OFF, CAMERA_PICTURES, CAMERA_DEPTH };

struct capture_options {
	enum { BOTH, ONLY_FORCE, ONLY_TRACKER } only;
	const char *rig, *calibration, *output;
	enum camera camera;
	struct incise_capture_options capture;
	bool json;
};

static const char *const cameras[] = {"auto", "off", "frames", "depth", NULL};

static const char *const triggers[] = {"button", "sync", NULL}; /* or a force */
#define SYNC_DEVICE "/dev/incise-stepper0"

static void parse_trigger(void *whole, char *text)
{
	static const struct cli_unit units[] = {{"N", 1}, {"mN", 1e-3}, {0}};
	struct incise_capture_options *capture =
		&((struct capture_options *)whole)->capture;

	capture->recorder.trigger_button = !strcmp(text, triggers[0]);
	capture->recorder.trigger_force_N = 0;
	capture->sync = NULL;
	if (!strcmp(text, triggers[1]))
		capture->sync = SYNC_DEVICE;
	else if (!strncmp(text, "sync:", 5) && text[5])
		capture->sync = text + 5;
	else if (!capture->recorder.trigger_button)
		capture->recorder.trigger_force_N =
			cli_quantity("--trigger", text, units, 1e-3, 1e4);
}

static void parse_start_at(void *whole, char *text)
{
	struct incise_error err = {0};

	if (incise_capture_start_at(&((struct capture_options *)whole)->capture, text,
				    &err))
		cli_usage("%s", err.text);
}

static void parse_clock_source(void *whole, char *text)
{
	struct incise_error err = {0};

	if (incise_recorder_check_clock_source(text, &err))
		cli_usage("%s", err.text);
	((struct capture_options *)whole)->capture.recorder.clock_source = text;
}

static const char *const onlys[] = {"force,tracker", "force", "tracker", NULL};

static const struct cli_option option_table[] = {
	{'o', "output", "NAME.rec",
	 "folder to record into; --overwrite replaces an existing one once the new "
	 "one is complete, and removes the rest of an interrupted one, "
	 "NAME.rec.part",
	 CLI_OUTPUTS(struct capture_options, output)},
	{CLI_RIG_OPTION(struct capture_options, rig)},
	CALIBRATION_OPTION(struct capture_options, calibration),
	{0, "duration", "TIME",
	 "end after this time, for example 10s, 500ms, 2min or 1h (default: at "
	 "Ctrl-C; on the simulated rig at the end of its cuts)",
	 CLI_DURATION(struct capture_options, capture.duration_s, 0.01, 1e6)},
	{0, "camera", "WHAT",
	 "off; frames: record frames; depth: also find the scalpel in them; auto: "
	 "as rig.conf has it (default; a rig sim:… then has no camera)",
	 CLI_CHOICE(struct capture_options, camera, cameras)},
	{0, "only", "LIST",
	 "force or tracker: record this stream alone (and the camera); "
	 "force,tracker: both (default)",
	 CLI_CHOICE(struct capture_options, only, onlys)},
	{0, "trigger", "WHAT",
	 "wait for the button of the stylus, for a force such as 0.2N, or for "
	 "sync[:DEVICE], a pulse of the SYNC line of the stepper module; the "
	 "second before it is recorded too",
	 CLI_PARSED_BY(parse_trigger), .names = triggers},
	{0, "start-at", "TIME",
	 "wait for a time, for example 2026-11-27T12:00:00Z (UTC), or with TAI in "
	 "place of Z; the second before it is recorded too",
	 CLI_PARSED_BY(parse_start_at)},
	{0, "clock-source", "SOURCE",
	 "where the wall time comes from: auto (default), ptp[:SOCKET[,DOMAIN]], "
	 "chrony[:PORT], kernel or none; of a simulated clock none (default) or "
	 "sim:TAI_S,PPM,BOUND_US",
	 CLI_PARSED_BY(parse_clock_source)},
	{0, "cuts", NULL, "mark the start and the end of each cut in the table events",
	 CLI_FLAG(struct capture_options, capture.recorder.cuts)},
	{0, "json", NULL, "report as one JSON object",
	 CLI_FLAG(struct capture_options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "capture",
	.synopsis = "-o NAME.rec [--rig RIG] [OPTIONS]",
	.summary =
		"Record tracker, force channel and camera of a rig in sync. Hold the tool "
		"clear of everything for the first half second: the zero of the force is "
		"measured then. On a terminal the keys m and 1 to 9 set markers, t "
		"triggers, q ends.",
	.options = option_table,
	.examples = "incise capture -o liver.rec --rig sim:clock=simulated",
	.success = "recorded without loss",
	.failure =
		"failure, lost samples, a failed device, a disk that was nearly full, or "
		"no signature by the key of the rig",
};

static void parse_options(struct capture_options *options, int argc, char **argv)
{
	const struct incise_capture_options *capture = &options->capture;
	const struct incise_recorder_setup *recorder = &capture->recorder;
	char *output;
	size_t length;

	cli_parse(&command, argc, argv, options);
	cli_no_operands(argc, argv, "-o");
	if (!options->output)
		cli_usage("missing -o NAME.rec (output recording)");
	if (options->only == ONLY_FORCE && recorder->trigger_button)
		cli_usage("--trigger button: needs the tracker, which --only force "
			  "leaves out; leave out one of them");
	if (options->only == ONLY_TRACKER && recorder->trigger_force_N > 0)
		cli_usage("--trigger: a force needs the force channel, which --only "
			  "tracker leaves out; leave out one of them");
	if (options->only == ONLY_FORCE && recorder->cuts)
		cli_usage("--cuts: needs the tracker, which --only force leaves out; "
			  "leave out one of them");
	if (capture->at_time && recorder->clock_source &&
	    !strcmp(recorder->clock_source, "none"))
		cli_usage("--start-at: needs the wall time, which --clock-source none "
			  "leaves out; leave out one of them");
	output = cli_text("%s", options->output);
	for (length = strlen(output); length > 1 && output[length - 1] == '/'; length--)
		output[length - 1] = 0;
	if (length < 5 || !cli_ends_with(output, ".rec") || output[length - 5] == '/')
		cli_usage("-o: expected a name that ends in .rec, found '%s'", output);
	if (length > PATH_MAX - 16)
		cli_usage("-o: the path is too long; give a shorter one");
	cli_output(output);
	options->output = output;
	if (capture->at_time &&
	    (recorder->trigger_button || recorder->trigger_force_N > 0 || capture->sync))
		cli_usage("--start-at and --trigger exclude each other; give one of "
			  "them");
}

/* --- recording ----------------------------------------------------------------------- */

static struct incise_rig *open_rig(const struct capture_options *options)
{
	static const unsigned int devices[] = {
		[BOTH] =
			INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_FORCE_IF_NAMED,
		[ONLY_FORCE] = INCISE_RIG_FORCE,
		[ONLY_TRACKER] = INCISE_RIG_TRACKER,
	};
	static const unsigned int camera[] = {
		[CAMERA_AUTO] = INCISE_RIG_CAMERA | INCISE_RIG_IF_NAMED,
		[CAMERA_PICTURES] = INCISE_RIG_CAMERA,
		[CAMERA_DEPTH] = INCISE_RIG_CAMERA,
	};

	struct incise_rig *rig = cli_open_rig(
		options->rig, devices[options->only] | camera[options->camera]);

	if (options->only == BOTH && !incise_rig_force(rig))
		cli_warn(
			"%s: no force is recorded: the rig has no force channel, and its "
			"haptic device gives no force meanwhile",
			incise_rig_spec(rig));
	return rig;
}

/* Whether the depth is measured in pictures. */
static bool use_vision(const struct capture_options *options, struct incise_rig *rig,
		       struct incise_vision_setup *vision)
{
	bool has = incise_rig_camera(rig) && !incise_rig_vision(rig, vision);

	if (options->camera == CAMERA_DEPTH && !has)
		cli_fail("%s: --camera depth needs a group vision, with the colour of "
			 "the handle; see 'incise help rig.conf'",
			 incise_rig_spec(rig));
	return has && options->camera != CAMERA_PICTURES;
}

static void print_warning(void *context, const char *text)
{
	(void)context;
	cli_warn("%s", text);
}

/*
 * Record into @target. With --overwrite a recording without a sample is removed, so that it does not
 * replace one with samples.
 */
static void record_rig(const struct capture_options *options, struct incise_rig *rig,
		       const char *target, struct incise_capture_result *result)
{
	const struct incise_recorder_stats *stats = &result->stats;
	struct incise_error err = {0};
	int rc;

	capture_view_begin(incise_clock_is_real(incise_rig_clock(rig)),
			   options->capture.recorder.vision);
	rc = incise_capture_run(target, rig, &options->capture, result, &err);
	/* The recording is closed: now the terminal may block. */
	capture_view_end();
	cli_check(rc && (rc != -ECANCELED || !cli_overwrite()), &err);
	if (!cli_overwrite() || stats->force || stats->tracker || stats->frames)
		return;
	recording_remove(target);
	if (result->early.code)
		cli_fail_with(&result->early);
	cli_fail("%s: %s; nothing was recorded, and nothing was replaced",
		 options->output,
		 rc ? "it was never triggered" : "no samples arrived; see incise doctor");
}

/* --- signature of the rig ---------------------------------------------------------------- */

/* The seal of a recording that is complete; "" where there is none. */
struct signing {
	char *key;		 /* path in rig.conf; NULL: none */
	char by[160];		 /* kind and fingerprint of the key */
	struct incise_error err; /* why it is not signed */
};

/* The recording stays as it is if it cannot be signed. */
static void sign_recording(const char *path, struct signing *signing)
{
	const struct incise_prove_options options = {.key = signing->key,
						     .recorded = true};
	struct incise_proof proof;

	if (!signing->key)
		return;
	if (!incise_prove(path, &options, &proof, &signing->err))
		strcpy(signing->by, proof.seals->vouchers->key);
	incise_proof_free(&proof);
}

int main(int argc, char **argv)
{
	struct capture_options options = {.capture = {.stop = &cli_stop,
						      .step = capture_view_step,
						      .warn = print_warning}};
	struct incise_recorder_setup *recorder = &options.capture.recorder;
	struct calibration_used calibration;
	struct incise_capture_result result;
	struct incise_vision_setup vision;
	struct incise_error err = {0};
	struct signing signing = {0};
	struct incise_rig *rig;
	char *target;

	parse_options(&options, argc, argv);
	rig = open_rig(&options);
	calibration_use(&calibration, options.calibration, cli_rig(options.rig));
	recorder->calibration = &calibration.values;
	recorder->calibration_path = calibration.path;
	recorder->vision = use_vision(&options, rig, &vision) ? &vision : NULL;
	target = recording_target(options.output);
	cli_catch_signals();
	record_rig(&options, rig, target, &result);
	if (incise_rig_sign_key(rig))
		signing.key = cli_text("%s", incise_rig_sign_key(rig));
	incise_rig_close(rig);
	recording_replace(target, options.output);
	free(target);
	sign_recording(options.output, &signing);
	capture_report(options.output, &result, &calibration, signing.by, options.json);
	if (signing.err.code)
		cli_error("%s: recorded, but not signed: %s; 'incise sign' signs it",
			  options.output, signing.err.text);
	cli_check(incise_capture_judge(options.output, &options.capture, &result, &err),
		  &err);
	incise_wall_free(result.wall);
	return !!signing.err.code;
}
