// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise sign: signs and time-stamps a recording, so that anyone can see later who vouches for it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "seal/members.h"
#include "seal/seal.h"

struct job {
	const char *key, *timestamp;
	bool json;
	json_t *signed_by, *stamped; /* of the report */
};

static const struct cli_option options[] = {
	{0, "key", "FILE",
	 "sign with this private key of ssh-keygen, or with the agent if it is a "
	 "public one, such as ~/.ssh/id_ed25519.pub",
	 CLI_INPUT(struct job, key)},
	{0, "timestamp", "WHERE",
	 "have the time certified (RFC 3161): http://… asks this authority, "
	 "FILE.tsq writes a query for one, FILE.tsr takes its reply",
	 CLI_OUTPUTS(struct job, timestamp)},
	{0, "json", NULL, "report as one JSON object", CLI_FLAG(struct job, json)},
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

/* Commit of the statement; null: it is that of a join. */
static json_t *commit(const struct seal *seal)
{
	return seal->joined ? json_null()
			    : json_integer((json_int_t)seal->statement.last.commit);
}

static void store(struct seal *seal, const char *path, const void *bytes, size_t n)
{
	struct incise_error err = {0};

	if (!seal->stored) {
		char *statement = seal_statement_path(seal);

		cli_output_within(statement);
		free(statement);
	}
	if (path)
		cli_output_within(path);
	if (seal_write(seal, path, bytes, n, &err))
		cli_fail_with(&err);
}

/* @member: of a joined recording; one that the same key has signed keeps that signature. */
static void sign(struct job *job, struct seal *seal, bool member)
{
	struct incise_error err = {0};
	struct signature signature;
	char *bytes = cli_require(seal_sign(seal, job->key, &signature, &err), &err);
	char *path = seal_signature_path(seal, &signature);
	char *extent = seal_extent(seal);

	if (!member || cli_overwrite() || access(path, F_OK))
		store(seal, path, bytes, strlen(bytes));
	if (job->json)
		json_array_append_new(job->signed_by,
				      json_pack("{so ss so so}", "path", json_text(path),
						"key", signature.key, "recording",
						json_text(seal->recording), "commit",
						commit(seal)));
	else
		printf("%s: signed with %s, %s\n", seal->recording, signature.key,
		       extent);
	free(bytes);
	free(extent);
	free(path);
}

/* --- time-stamps ------------------------------------------------------------------------ */

static void write_query(struct job *job, struct seal *seal, const struct der *query)
{
	struct incise_error err = {0};
	struct incise_outfile *file;

	store(seal, NULL, NULL, 0);
	file = cli_require(incise_outfile_open(job->timestamp, &err), &err);
	fwrite(query->bytes, 1, query->n, incise_outfile_stream(file));
	if (incise_outfile_commit(file, &err))
		cli_fail_with(&err);
	if (!job->json)
		printf("%s: query for a time-stamp, statement of commit %lld; send it to "
		       "an authority, and store its reply with --timestamp FILE.tsr\n",
		       seal->recording, (long long)seal->statement.last.commit);
}

static void read_reply(const char *path, struct der *reply)
{
	static const struct incise_infile_kind kind = {
		.name = "a reply of RFC 3161",
		.advice = "give the reply of a time-stamp authority",
		.size_max = TIMESTAMP_MAX,
	};
	struct incise_error err = {0};

	reply->bytes =
		cli_require(incise_infile_read(path, &kind, &reply->n, &err), &err);
}

static void take_reply(struct job *job, struct seal *seal, const struct der *reply,
		       const struct der *query)
{
	unsigned char digest[TIMESTAMP_DIGEST];
	struct timestamp timestamp;
	struct incise_error err = {0};
	char *path, *extent = seal_extent(seal);

	timestamp_digest(seal->text, seal->n, digest);
	if (timestamp_read(reply, job->timestamp, digest, query, &timestamp, &err))
		cli_fail_with(&err);
	path = seal_timestamp_path(seal, &timestamp);
	store(seal, path, reply->bytes, reply->n);
	if (job->json)
		json_array_append_new(
			job->stamped,
			json_pack("{so ss so so so}", "path", json_text(path), "utc",
				  timestamp.utc, "authority",
				  json_text_or_null(timestamp.authority), "recording",
				  json_text(seal->recording), "commit",
				  (json_int_t)seal->statement.last.commit));
	else
		printf("%s: time-stamped %s by %s, %s\n", seal->recording, timestamp.utc,
		       *timestamp.authority ? timestamp.authority
					    : "an unnamed authority",
		       extent);
	free(path);
	free(extent);
}

static void stamp(struct job *job, struct seal *seal)
{
	unsigned char digest[TIMESTAMP_DIGEST];
	struct der query = {0}, reply = {0};
	struct incise_error err = {0};

	if (cli_ends_with(job->timestamp, ".tsr")) {
		read_reply(job->timestamp, &reply);
		take_reply(job, seal, &reply, NULL);
		free(reply.bytes);
		return;
	}
	timestamp_digest(seal->text, seal->n, digest);
	if (timestamp_query(digest, &query, &err))
		cli_fail_with(&err);
	if (timestamp_is_server(job->timestamp)) {
		if (timestamp_ask(job->timestamp, &query, &reply, &err))
			cli_fail_with(&err);
		take_reply(job, seal, &reply, &query);
		free(reply.bytes);
	} else {
		write_query(job, seal, &query);
	}
	free(query.bytes);
}

/* --- the command ------------------------------------------------------------------------- */

static char *parse(struct job *job, int argc, char **argv)
{
	char *path;

	cli_parse(&command, argc, argv, job);
	path = cli_operand(argc, argv, "NAME.rec", "recording to sign");
	if (!job->key && !job->timestamp)
		cli_usage("missing --key FILE (key to sign with) or --timestamp WHERE");
	if (job->timestamp && !timestamp_is_server(job->timestamp) &&
	    !cli_ends_with(job->timestamp, ".tsq") &&
	    !cli_ends_with(job->timestamp, ".tsr"))
		cli_usage("--timestamp: expected http://…, FILE.tsq or FILE.tsr, found "
			  "'%.60s'",
			  job->timestamp);
	if (job->timestamp && cli_ends_with(job->timestamp, ".tsq"))
		cli_output(job->timestamp);
	else if (job->timestamp)
		cli_input(job->timestamp);
	return (char *)file_operand(path, FILE_RECORDING);
}

int main(int argc, char **argv)
{
	struct job job = {.signed_by = json_array(), .stamped = json_array()};
	struct incise_error err = {0};
	const char *path = parse(&job, argc, argv);
	struct members members;

	members_find(&members, path);
	for (int i = 0; i < members.n; i++) {
		struct seal seal;

		if (seal_open(&seal, members.path[i], true, &err))
			cli_fail_with(&err);
		if (job.key)
			sign(&job, &seal, i < members.n - 1);
		/* A file is one time-stamp: of the join, whose statement names the members'. */
		if (job.timestamp &&
		    (i == members.n - 1 || timestamp_is_server(job.timestamp)))
			stamp(&job, &seal);
		seal_close(&seal);
	}
	members_free(&members);
	if (job.json)
		json_print(json_pack("{so so so}", "path", json_text(path), "signatures",
				     job.signed_by, "timestamps", job.stamped));
	else
		cli_written();
	cli_finish();
	return 0;
}
