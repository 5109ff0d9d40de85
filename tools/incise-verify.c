// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise verify: proves that a recording is complete, or says what is missing and where.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/recalibration.h>
#include <incise/recording.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/proof_report.h"

#define FINDINGS_MAX 1000 /* in the JSON object */

struct verify_job {
	struct incise_prove_options prove;
	bool json;
};

static const struct cli_option options[] = {
	{0, "signers", "FILE",
	 "check signatures and say who vouches for what; FILE lists who may sign, "
	 "in the format ALLOWED SIGNERS of ssh-keygen(1)",
	 CLI_INPUT(struct verify_job, prove.signers)},
	{0, "revoked", "FILE",
	 "keys that are not accepted: public keys, or a list of ssh-keygen -k",
	 CLI_INPUT(struct verify_job, prove.revoked)},
	{0, "ca", "FILE", "certificates of authorities in PEM: check time-stamps by them",
	 CLI_INPUT(struct verify_job, prove.authorities)},
	{0, "json", NULL, "report as one JSON object", CLI_FLAG(struct verify_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "verify",
	.synopsis = "NAME.rec [OPTIONS]",
	.summary =
		"Check that a recording is complete and as it was written: recompute its "
		"ledger and seal, and check the pages of its database. Lists what is "
		"missing or altered, and where.",
	.options = options,
	.examples = "incise verify liver.rec",
	.success = "complete, and signed if --signers is given",
	.failure = "something is missing, altered or not signed",
};

/* Findings are printed as lines, or kept in a list. */
struct sink {
	json_t *list; /* NULL: lines */
	const char *path;
	uint64_t left_out;
	uint64_t times; /* rows whose times are not to be trusted */
	struct cli_bar progress;
};

static json_t *known(int64_t value, bool is)
{
	return is ? json_integer(value) : json_null();
}

static json_t *as_json(const struct incise_verify_finding *finding)
{
	static const char *const kinds[] = {
		[INCISE_VERIFY_LOST] = "lost",
		[INCISE_VERIFY_ALTERED] = "altered",
		[INCISE_VERIFY_LEDGER] = "ledger",
		[INCISE_VERIFY_EXTRA] = "extra",
		[INCISE_VERIFY_COUNT] = "count",
		[INCISE_VERIFY_INTERRUPTED] = "interrupted",
		[INCISE_VERIFY_FRAMES] = "pictures",
		[INCISE_VERIFY_UNVERIFIED] = "unverified",
		[INCISE_VERIFY_DAMAGED] = "damaged",
		[INCISE_VERIFY_ENDED] = "ended",
		[INCISE_VERIFY_TIMES] = "times",
		[INCISE_VERIFY_SEAL] = "seal",
	};
	bool numbers = finding->last_seq >= finding->first_seq;
	bool blocks = finding->first_block >= 0;

	return json_pack("{ss so so so so so so so sI so}", "kind", kinds[finding->kind],
			 "stream", json_text_or_null(finding->stream), "first_block",
			 known(finding->first_block, blocks), "last_block",
			 known(finding->last_block, blocks), "first_seq",
			 known(finding->first_seq, numbers), "last_seq",
			 known(finding->last_seq, numbers), "first_ns",
			 known(finding->first_ns, finding->first_ns >= 0), "last_ns",
			 known(finding->last_ns, finding->last_ns >= 0), "count",
			 (json_int_t)finding->count, "text", json_text(finding->text));
}

static void found(void *user, const struct incise_verify_finding *finding)
{
	struct sink *sink = user;

	if (finding->kind == INCISE_VERIFY_TIMES)
		sink->times += finding->count;
	if (!sink->list) {
		cli_progress_end();
		printf("%s: %s\n", sink->path, finding->text);
	} else if (json_array_size(sink->list) < FINDINGS_MAX) {
		json_array_append_new(sink->list, as_json(finding));
	} else {
		sink->left_out++;
	}
}

static int progress(void *user, double share)
{
	struct sink *sink = user;

	if (share < 0)
		cli_progress("%s: checking the pages of the database", sink->path);
	else
		cli_progress_bar(sink->path, share, &sink->progress);
	return cli_stop;
}

/* The state of the camera's file; null where the recording has none. */
static json_t *pictures(const struct incise_verify_report *report)
{
	const struct incise_verify_frames *frames = &report->frames;

	if (!report->n_streams ||
	    strcmp(report->streams[report->n_streams - 1].name, "camera"))
		return json_null();
	return json_pack("{sb sI sI sI sI sI}", "checked", frames->checked, "present",
			 (json_int_t)frames->present, "missing",
			 (json_int_t)frames->missing, "altered",
			 (json_int_t)frames->altered, "extra", (json_int_t)frames->extra,
			 "ahead", (json_int_t)frames->ahead);
}

/* The calibration that is active in place of that of the capture; false: none is. */
static bool recalibrated(const char *path, struct incise_recalibration *active)
{
	struct incise_recalibration *list;
	int n = incise_recalibrations(path, &list, NULL);
	bool is = n > 0 && !list[0].active;

	if (is)
		*active = list[n - 1];
	free(list);
	return is;
}

static void print_verify_json(const struct incise_verify_report *report,
			      const struct sink *sink, json_t *vouches)
{
	struct incise_recalibration active;
	json_t *streams = json_array();

	for (int i = 0; i < report->n_streams; i++) {
		const struct incise_verify_stream *stream = &report->streams[i];

		json_array_append_new(
			streams, json_pack("{ss sI sI sI sI sI sI}", "name", stream->name,
					   "expected", (json_int_t)stream->expected,
					   "present", (json_int_t)stream->present, "lost",
					   (json_int_t)stream->lost, "lost_at_capture",
					   (json_int_t)stream->lost_at_capture, "blocks",
					   (json_int_t)stream->blocks, "altered_blocks",
					   (json_int_t)stream->altered));
	}
	json_print(json_pack(
		"{so sb sb sb sb sb sI so so so so sI so}", "path", json_text(sink->path),
		"complete", report->complete, "intact", report->intact, "unverified",
		report->unverified, "interrupted", report->interrupted, "sealed",
		report->sealed, "commits", (json_int_t)report->commits, "pictures",
		pictures(report), "recalibrated",
		recalibrated(sink->path, &active) ? json_text(active.file) : json_null(),
		"streams", streams, "findings", sink->list, "findings_left_out",
		(json_int_t)sink->left_out, "seals", vouches));
}

static void print_table(const struct incise_verify_report *report, const char *path)
{
	struct incise_recalibration active;

	for (int i = 0; i < report->n_streams; i++) {
		const struct incise_verify_stream *stream = &report->streams[i];

		printf("%-8s %llu expected, %llu present, %llu lost, in %s", stream->name,
		       (unsigned long long)stream->expected,
		       (unsigned long long)stream->present,
		       (unsigned long long)stream->lost,
		       cli_count(stream->blocks, "block"));
		if (stream->altered)
			printf(", %llu of them altered",
			       (unsigned long long)stream->altered);
		printf("\n");
	}
	if (report->frames.checked)
		printf("%-8s %s as written, %llu missing, %llu altered, %llu without a row\n",
		       "", cli_count(report->frames.present, "frame"),
		       (unsigned long long)report->frames.missing,
		       (unsigned long long)report->frames.altered,
		       (unsigned long long)report->frames.extra);
	if (report->sealed)
		printf("%-8s %s, chained\n", "seal",
		       cli_count(report->commits, "commit"));
	if (recalibrated(path, &active))
		printf("%s: read by another calibration than that of the capture: %s\n",
		       path, active.file);
	if (report->complete)
		printf("%s: complete, and as it was written\n", path);
}

/* The reason in one line why nobody vouches for it; fails the program with it. */
_Noreturn static void fail_unvouched(const struct incise_proof_seal *seal,
				     const char *signers)
{
	if (seal->join && !seal->n_vouchers)
		cli_fail("%s: its members are signed, the times of the join are not: "
			 "'incise sign %s' signs them",
			 seal->path, seal->path);
	if (seal->bad)
		cli_fail("%s: not everyone who vouches for it may: bad signatures, "
			 "time-stamps or statements: %d",
			 seal->path, seal->bad);
	if (!seal->n_vouchers)
		cli_fail("%s: not signed: %s%s", seal->path,
			 *seal->why ? seal->why : "'incise sign' signs it",
			 access(cli_text("%s/seal-before", seal->path), F_OK)
				 ? ""
				 : "; seal-before/ has signatures of it before its "
				   "conversion");
	cli_fail("%s: nobody in %s signed what it is now", seal->path, signers);
}

/* Fail if someone was to be named who vouches for it, and nobody does. */
static void judge_proof(const struct incise_proof *proof, const char *signers)
{
	for (int i = 0; i < proof->n && signers; i++)
		if (!proof->seals[i].vouched || proof->seals[i].bad)
			fail_unvouched(&proof->seals[i], signers);
}

/* Why a recording is not complete, in one line. */
_Noreturn static void fail_incomplete(const struct incise_verify_report *report,
				      const struct sink *sink)
{
	unsigned long long lost = 0;

	for (int i = 0; i < report->n_streams; i++)
		lost += report->streams[i].lost;
	if (report->unverified)
		cli_fail("%s: not all of it could be verified; %llu samples missing, "
			 "findings: %llu",
			 sink->path, lost, (unsigned long long)report->findings);
	if (!report->intact)
		cli_fail("%s: not as it was recorded: %llu samples missing, findings: "
			 "%llu; copy it before you do anything else with it",
			 sink->path, lost, (unsigned long long)report->findings);
	if (report->interrupted)
		cli_fail("%s: interrupted: its end is missing; the committed part is as "
			 "it was written, %llu samples were lost",
			 sink->path, lost);
	if (sink->times && !lost)
		cli_fail("%s: %llu rows of the tracker have an unreliable time; the "
			 "rest is as it was written",
			 sink->path, (unsigned long long)sink->times);
	if (!lost)
		cli_fail("%s: a device was disconnected before the end; the rest is as "
			 "it was written",
			 sink->path);
	cli_fail("%s: %llu samples were lost during the capture; the rest is as it was "
		 "written",
		 sink->path, lost);
}

int main(int argc, char **argv)
{
	struct sink sink = {0};
	struct incise_verify_watch watch = {found, progress, &sink};
	struct verify_job job = {.prove = {.level = INCISE_PROVE_ALL, .watch = &watch}};
	struct incise_error err = {0};
	struct incise_proof proof;

	cli_parse(&command, argc, argv, &job);
	if (optind == argc)
		cli_usage("missing NAME.rec (recording to check)");
	if (optind + 1 < argc)
		cli_usage("unexpected argument '%s'; give one NAME.rec at a time",
			  argv[optind + 1]);
	if ((job.prove.authorities || job.prove.revoked) && !job.prove.signers)
		cli_usage("--%s goes with --signers FILE",
			  job.prove.authorities ? "ca" : "revoked");
	sink.path = file_operand(argv[optind], FILE_RECORDING);
	sink.list = job.json ? json_array() : NULL;
	cli_catch_signals();
	cli_check(incise_prove(sink.path, &job.prove, &proof, &err), &err);
	cli_progress_end();
	if (job.json) {
		print_verify_json(&proof.report, &sink, proof_json(&proof));
	} else {
		print_table(&proof.report, sink.path);
		proof_print(&proof, job.prove.signers);
	}
	cli_finish();
	if (!proof.report.complete)
		fail_incomplete(&proof.report, &sink);
	judge_proof(&proof, job.prove.signers);
	incise_proof_free(&proof);
	return 0;
}
