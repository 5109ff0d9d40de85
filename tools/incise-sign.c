// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise sign: signs and time-stamps a recording, so that anyone can see later who vouches for it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/proof_report.h"

struct sign_job {
	struct incise_prove_options prove;
	bool json;
};

static const struct cli_option options[] = {
	{0, "key", "FILE",
	 "sign with this private key of ssh-keygen, or with the agent if it is a "
	 "public one, such as ~/.ssh/id_ed25519.pub",
	 CLI_INPUT(struct sign_job, prove.key)},
	{0, "timestamp", "WHERE",
	 "have the time certified (RFC 3161): http://… asks this authority, "
	 "FILE.tsq writes a query for one, FILE.tsr takes its reply",
	 CLI_OUTPUTS(struct sign_job, prove.timestamp)},
	{0, "json", NULL, "report as one JSON object", CLI_FLAG(struct sign_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "sign",
	.synopsis = "NAME.rec [--key FILE] [--timestamp WHERE] [OPTIONS]",
	.summary =
		"Verify a recording, and sign a statement of all that is in it, with a "
		"key of SSH. The signature is stored in the recording, in NAME.rec/seal/, "
		"and the data stay as they are.",
	.options = options,
	.examples = "incise sign liver.rec --key ~/.ssh/id_ed25519",
};

/* Note an output, which may exist with --overwrite alone. */
static int write_file(void *user, const char *path)
{
	(void)user;
	cli_output_within(path);
	return 0;
}

static json_t *voucher_json(const struct incise_proof_seal *seal,
			    const struct incise_proof_voucher *v)
{
	const bool stamp = v->kind == INCISE_PROOF_TIMESTAMP;
	char *path = cli_text("%s/seal/%s", seal->path, v->file);
	json_t *object =
		json_pack("{so so so so}", "path", json_text(path), stamp ? "utc" : "key",
			  json_text(stamp ? v->utc : v->key), "recording",
			  json_text(seal->path), "commit",
			  seal->join && !stamp
				  ? json_null()
				  : json_integer((json_int_t)seal->statements->commit));

	if (stamp)
		json_object_set_new(object, "authority", json_text_or_null(v->by));
	free(path);
	return object;
}

static void print_sign_json(const char *path, const struct incise_proof *proof)
{
	json_t *vouchers[] = {json_array(), json_array()};

	for (int i = 0; i < proof->n; i++)
		for (int k = 0; k < proof->seals[i].n_vouchers; k++) {
			const struct incise_proof_voucher *v =
				&proof->seals[i].vouchers[k];

			json_array_append_new(vouchers[v->kind == INCISE_PROOF_TIMESTAMP],
					      voucher_json(&proof->seals[i], v));
		}
	json_print(json_pack("{so so so}", "path", json_text(path), "signatures",
			     vouchers[0], "timestamps", vouchers[1]));
}

static bool is_server(const char *where)
{
	return !strncmp(where, "http://", 7) || !strncmp(where, "https://", 8);
}

static char *parse_sign(struct sign_job *job, int argc, char **argv)
{
	const char *timestamp;
	char *path;

	cli_parse(&command, argc, argv, job);
	timestamp = job->prove.timestamp;
	path = cli_operand(argc, argv, "NAME.rec", "recording to sign");
	if (!job->prove.key && !timestamp)
		cli_usage("missing --key FILE (key to sign with) or --timestamp WHERE");
	if (timestamp && !is_server(timestamp) && !cli_ends_with(timestamp, ".tsq") &&
	    !cli_ends_with(timestamp, ".tsr"))
		cli_usage("--timestamp: expected http://…, FILE.tsq or FILE.tsr, found "
			  "'%.60s'",
			  timestamp);
	if (timestamp && cli_ends_with(timestamp, ".tsq"))
		cli_output(timestamp);
	else if (timestamp)
		cli_input(timestamp);
	return (char *)file_operand(path, FILE_RECORDING);
}

int main(int argc, char **argv)
{
	struct sign_job job = {.prove.write = write_file};
	struct incise_error err = {0};
	const char *path = parse_sign(&job, argc, argv);
	const struct incise_proof_seal *last;
	struct incise_proof proof;
	int rc;

	job.prove.renew = cli_overwrite();
	rc = incise_prove(path, &job.prove, &proof, &err);
	if (!job.json)
		proof_print(&proof, true);
	cli_check(rc, &err);
	last = &proof.seals[proof.n - 1];
	if (job.json)
		print_sign_json(path, &proof);
	else if (job.prove.timestamp && cli_ends_with(job.prove.timestamp, ".tsq"))
		printf("%s: query for a time-stamp, statement of commit %lld; send it to "
		       "an authority, and store its reply with --timestamp FILE.tsr\n",
		       last->path, (long long)last->statements->commit);
	if (!job.json)
		cli_written();
	incise_proof_free(&proof);
	cli_finish();
	return 0;
}
