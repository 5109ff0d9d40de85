// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The chain of a recording's commits recomputed, and compared with a statement; see verify.h.
 *
 *     statement   head 0 ──── head 31 ──── head 62 ──── last head 97     parts
 *     recording   head 0 ──── head 31 ──x─ other ────── other            force differs
 *                                       └ between commits 32 and 62
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "seal_walk.h"
#include "verify.h"

struct verify_seal_walk {
	struct incise_verification *verify;
	struct incise_verify_finding wrong; /* commits in a row; first_block -1: none */
	bool bad;			    /* any commit was */
	int64_t last, last_ns;
	uint64_t behind; /* rows behind the last commit */
	bool blocks;	 /* and blocks of the ledger */
};

static struct incise_verify_finding finding(const char *part)
{
	struct incise_verify_finding found = incise_verify_finding(INCISE_VERIFY_SEAL);

	found.stream = part;
	return found;
}

/* --- the chain ------------------------------------------------------------------------ */

static void flush_wrong(struct verify_seal_walk *walk)
{
	struct incise_verify_finding *found = &walk->wrong;
	char commits[80];

	if (found->first_block < 0)
		return;
	if (found->first_block == found->last_block)
		snprintf(commits, sizeof(commits), "commit %lld differs",
			 (long long)found->first_block);
	else
		snprintf(commits, sizeof(commits), "commits %lld to %lld differ",
			 (long long)found->first_block, (long long)found->last_block);
	incise_verify_found(
		walk->verify, *found,
		"seal: %s, up to %.4f s: %s, the ledger or the seal are not those written",
		commits, incise_verify_s(walk->verify, found->last_ns),
		found->first_block ? "rows or tables" : "table meta of the start, rows");
	*found = finding("");
}

static int step_verify_seal(void *user, struct incise_seal_walk *commit)
{
	struct verify_seal_walk *walk = user;
	struct incise_verification *verify = walk->verify;
	const bool tables =
		commit->number == commit->last && verify->recording->meta.complete;

	verify->report->commits++;
	walk->last = commit->number;
	walk->last_ns = commit->t_ns;
	walk->bad |= !commit->good;
	if (commit->number == commit->last)
		walk->behind = incise_seal_walk_behind(commit, &walk->blocks);
	if (commit->good || (tables ? verify->tables_altered : verify->rows_altered)) {
		flush_wrong(walk);
	} else {
		if (walk->wrong.first_block < 0)
			walk->wrong.first_block = commit->number;
		walk->wrong.last_block = commit->number;
		walk->wrong.last_ns = commit->t_ns;
		walk->wrong.count++;
	}
	return incise_verify_progress(verify, false);
}

static void report_behind(struct verify_seal_walk *walk)
{
	struct incise_verify_finding found = finding("");

	flush_wrong(walk);
	if ((!walk->behind && !walk->blocks) || walk->verify->rows_altered)
		return;
	walk->bad = true;
	found.count = walk->behind;
	incise_verify_found(walk->verify, found,
			    "seal: %llu rows are behind its last commit, %lld",
			    (unsigned long long)walk->behind, (long long)walk->last);
}

/* --- a statement ------------------------------------------------------------------------ */

/* The heads around the first difference: @from is the last one that agrees, or NULL. */
static bool find_difference(const struct incise_seal_statement *was,
			    const struct incise_seal_statement *is,
			    const struct incise_seal_head **from,
			    const struct incise_seal_head **to)
{
	*from = NULL;
	for (int i = 0; i < was->n_earlier; i++) {
		*to = &was->earlier[i];
		/* The recording has ended before. */
		if (!*is->earlier[i].head)
			return false;
		if (strcmp(was->earlier[i].head, is->earlier[i].head) != 0)
			return true;
		*from = *to;
	}
	*to = &was->last;
	return is->last.commit == was->last.commit &&
	       strcmp(was->last.head, is->last.head) != 0;
}

/* Where something differs, by the heads; of two or more parts it is where the first does. */
static void describe_place(const struct incise_verification *verify,
			   const struct incise_seal_head *from,
			   const struct incise_seal_head *to,
			   struct incise_verify_finding *found, char *text, size_t size)
{
	found->first_block = from ? from->commit + 1 : 0;
	found->last_block = to->commit;
	found->last_ns = to->t_ns;
	if (from)
		found->first_ns = from->t_ns;
	if (from)
		snprintf(text, size, "from a commit of %lld to %lld on (%.4f to %.4f s)",
			 (long long)found->first_block, (long long)found->last_block,
			 incise_verify_s(verify, from->t_ns),
			 incise_verify_s(verify, to->t_ns));
	else
		snprintf(text, size, "from the start on");
}

/* Whether the part can be compared: tables are those of the very commit only. */
static bool is_comparable(int part, bool same_commit)
{
	return same_commit || part < INCISE_SEAL_DEPTH;
}

/* Report the parts that differ; returns their number. */
static int compare_parts(struct incise_verification *verify,
			 const struct incise_seal_statement *was,
			 const struct incise_seal_statement *is, bool same_commit,
			 const struct incise_seal_head *from,
			 const struct incise_seal_head *to)
{
	int n = 0;

	for (int i = 0; i < INCISE_SEAL_PARTS; i++) {
		const struct incise_seal_part *a = &was->parts[i], *b = &is->parts[i];
		struct incise_verify_finding found = finding(incise_seal_parts[i]);
		const bool stream = i >= INCISE_SEAL_STREAM && i < INCISE_SEAL_DEPTH;
		char place[120] = "", rows[80];

		if (!is_comparable(i, same_commit) ||
		    (a->rows == b->rows && !strcmp(a->digest, b->digest)))
			continue;
		if (stream && to)
			describe_place(verify, from, to, &found, place, sizeof(place));
		snprintf(rows, sizeof(rows), ": %llu %s, and %llu when it was signed",
			 (unsigned long long)b->rows,
			 i == INCISE_SEAL_FILE ? "bytes" : "rows",
			 (unsigned long long)a->rows);
		found.count = b->rows;
		incise_verify_found(verify, found, "%s differs from the statement%s%s%s",
				    found.stream, *place ? ", " : "", place,
				    a->rows == b->rows ? "" : rows);
		n++;
	}
	return n;
}

static void compare_statement(struct verify_seal_walk *walk,
			      const struct incise_seal_statement *was,
			      const struct incise_seal_statement *is)
{
	struct incise_verification *verify = walk->verify;
	struct incise_verify_finding found = finding("seal");
	const struct incise_seal_head *from, *to;
	const bool fewer = walk->last < was->last.commit;
	const bool same = walk->last == was->last.commit;
	bool differs;
	char place[120];
	int n;

	if (strcmp(was->identity, is->identity) != 0) {
		found.stream = "start";
		incise_verify_found(verify, found,
				    "the statement is of another recording: it has the "
				    "identity %s, this one %s",
				    was->identity, is->identity);
		return;
	}
	if (incise_seal_before(verify->recording, was->last.head)) {
		incise_verify_found(verify, found,
				    "the statement is of this recording before its "
				    "conversion from an older format: keep it in "
				    "seal-before/, and sign the recording as it is now");
		return;
	}
	differs = find_difference(was, is, &from, &to);
	if (fewer) {
		found.first_block = walk->last + 1;
		found.last_block = was->last.commit;
		found.first_ns = walk->last_ns;
		found.last_ns = was->last.t_ns;
		incise_verify_found(
			verify, found,
			"ends with commit %lld of the %lld that were signed, at %.4f of "
			"%.4f s: its end was removed",
			(long long)walk->last, (long long)was->last.commit,
			incise_verify_s(verify, walk->last_ns),
			incise_verify_s(verify, was->last.t_ns));
	}
	/* With fewer commits all digests are others. */
	n = fewer && !differs
		    ? 0
		    : compare_parts(verify, was, is, same, from, differs ? to : NULL);
	if (!n && differs) {
		describe_place(verify, from, to, &found, place, sizeof(place));
		incise_verify_found(verify, found,
				    "seal: its heads differ from the statement, %s: "
				    "ledger, times or numbers of commits were changed",
				    place);
	}
	if (walk->last > was->last.commit) {
		found = finding("seal");
		found.first_block = was->last.commit + 1;
		found.last_block = walk->last;
		found.first_ns = was->last.t_ns;
		found.last_ns = walk->last_ns;
		incise_verify_found(
			verify, found,
			"commits %lld to %lld, %.4f to %.4f s, are behind the last one "
			"that was signed: the statement does not cover them, nor depth, "
			"events, knots, streams and meta",
			(long long)found.first_block, (long long)found.last_block,
			incise_verify_s(verify, found.first_ns),
			incise_verify_s(verify, found.last_ns));
	}
}

int incise_verify_seal(struct incise_verification *verify)
{
	const uint64_t before = verify->report->findings;
	const struct incise_seal_statement *was = verify->statement;
	struct verify_seal_walk walk = {
		.verify = verify, .wrong = finding(""), .last = -1};
	struct incise_seal_statement is;
	struct incise_error err = {0};
	/* With rows that the ledger does not have, blocks are not those of the digests. */
	const bool known = verify->hashed && !verify->rows_altered;
	int rc = incise_statement_make(&is, verify->recording, known,
				       was ? was->last.commit : -1, step_verify_seal,
				       &walk, &err);

	if (rc == -ECANCELED)
		return rc;
	if (rc) {
		incise_verify_found(verify, incise_verify_finding(INCISE_VERIFY_DAMAGED),
				    "%s", err.text);
		return 0;
	}
	report_behind(&walk);
	if (was)
		compare_statement(&walk, was, &is);
	verify->report->sealed = !walk.bad && !verify->rows_altered &&
				 !verify->tables_altered &&
				 verify->report->findings == before;
	return 0;
}
