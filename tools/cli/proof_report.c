// SPDX-License-Identifier: GPL-2.0-or-later
/* The proof of a recording, for people and as JSON; see proof_report.h. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "json.h"
#include "proof_report.h"

/* --- who vouches for it ----------------------------------------------------------------- */

/* "all of it, statement of commit 97": free(3). */
static char *extent_of(const struct incise_proof_seal *seal,
		       const struct incise_proof_voucher *voucher)
{
	const struct incise_proof_statement *s = NULL;

	for (int i = 0; i < seal->n_statements && !s; i++)
		if (seal->statements[i].number == voucher->statement)
			s = &seal->statements[i];
	if (!s || s->commit < 0)
		return cli_text("statement %d", voucher->statement);
	if (seal->join)
		return cli_text(s->agrees ? "the times of the join"
					  : "but not for what it is now");
	return cli_text("%s%s, statement of commit %lld",
			!s->recorded	 ? "but not for what it is now"
			: !s->calibrated ? "what was recorded, but not its calibration"
			: s->complete	 ? "all of it"
			: voucher->made	 ? "up to where it was interrupted"
					 : "all of it up to the interruption",
			s->recorded && s->calibrated && !s->agrees
				? ", but under another name"
				: "",
			(long long)s->commit);
}

static void print_voucher(const struct incise_proof_seal *seal,
			  const struct incise_proof_voucher *v)
{
	char *extent = extent_of(seal, v);

	if (v->verdict == INCISE_PROOF_BAD)
		printf("%s: seal/%s: %s%s%s%s\n", seal->path, v->file, v->why,
		       *v->key ? " (" : "", v->key, *v->key ? ")" : "");
	else if (v->kind == INCISE_PROOF_TIMESTAMP)
		printf("%s: time-stamped %s by %s%s, %s\n", seal->path, v->utc,
		       *v->by ? v->by : "an unnamed authority",
		       v->made || v->verdict == INCISE_PROOF_GOOD
			       ? ""
			       : ", not checked: give --ca FILE",
		       extent);
	else if (v->made)
		printf("%s: signed with %s, %s\n", seal->path, v->key, extent);
	else
		printf("%s: signed by %s (%s), %s\n", seal->path, v->by, v->key, extent);
	free(extent);
}

static void print_seal(const struct incise_proof_seal *seal, bool signers)
{
	for (int i = seal->n_statements - 1; i >= 0; i--) {
		const struct incise_proof_statement *s = &seal->statements[i];

		for (int k = 0; k < s->n_differences && !s->reported; k++)
			printf("%s: statement %d: %s\n", seal->path, s->number,
			       s->differences[k]);
	}
	for (int i = 0; i < seal->n_vouchers && signers; i++)
		print_voucher(seal, &seal->vouchers[i]);
	if (seal->n_vouchers && !signers)
		printf("%s: %s and %s, not checked: give --signers FILE\n", seal->path,
		       cli_count((uint64_t)seal->signatures, "signature"),
		       cli_count((uint64_t)seal->timestamps, "time-stamp"));
}

void proof_print(const struct incise_proof *proof, bool signers)
{
	for (int i = 0; i < proof->n; i++)
		print_seal(&proof->seals[i], signers);
}

static json_t *statement_json(const struct incise_proof_seal *seal,
			      const struct incise_proof_statement *s)
{
	json_t *differences = json_array();

	for (int i = 0; i < s->n_differences; i++)
		json_array_append_new(differences, json_text(s->differences[i]));
	return json_pack("{si so sb sb so}", "statement", s->number, "commit",
			 s->commit < 0 || seal->join
				 ? json_null()
				 : json_integer((json_int_t)s->commit),
			 "agrees", s->agrees, "signed", s->vouched, "differences",
			 differences);
}

static json_t *voucher_json(const struct incise_proof_voucher *v)
{
	static const char *const verdicts[] = {[INCISE_PROOF_GOOD] = "good",
					       [INCISE_PROOF_BAD] = "bad",
					       [INCISE_PROOF_UNCHECKED] = "unchecked"};
	bool stamp = v->kind == INCISE_PROOF_TIMESTAMP;
	json_t *object = json_pack("{ss si ss so}", "file", v->file, "statement",
				   v->statement, "verdict", verdicts[v->verdict], "why",
				   json_text_or_null(v->why));

	json_object_set_new(object, stamp ? "utc" : "signer",
			    json_text_or_null(stamp ? v->utc : v->by));
	json_object_set_new(object, stamp ? "authority" : "key",
			    json_text_or_null(stamp ? v->by : v->key));
	return object;
}

json_t *proof_json(const struct incise_proof *proof)
{
	json_t *list = json_array();

	for (int i = 0; i < proof->n; i++) {
		const struct incise_proof_seal *seal = &proof->seals[i];
		json_t *statements = json_array(),
		       *vouchers[] = {json_array(), json_array()};

		for (int k = 0; k < seal->n_statements; k++)
			json_array_append_new(statements,
					      statement_json(seal, &seal->statements[k]));
		for (int k = 0; k < seal->n_vouchers; k++)
			json_array_append_new(vouchers[seal->vouchers[k].kind ==
						       INCISE_PROOF_TIMESTAMP],
					      voucher_json(&seal->vouchers[k]));
		json_array_append_new(
			list,
			json_pack("{so sb so so so}", "path", json_text(seal->path),
				  "vouched", seal->vouched, "statements", statements,
				  "signatures", vouchers[0], "timestamps", vouchers[1]));
	}
	return list;
}

/* --- heads ------------------------------------------------------------------------------ */

json_t *proof_heads_json(const struct incise_proof *proof)
{
	json_t *list = json_array();

	for (int i = 0; i < proof->n; i++) {
		const struct incise_proof_seal *seal = &proof->seals[i];
		bool has = *seal->identity;

		json_array_append_new(
			list,
			json_pack("{so so so so so si si}", "path", json_text(seal->path),
				  "identity", json_text_or_null(seal->identity), "commit",
				  has ? json_integer((json_int_t)seal->head.commit)
				      : json_null(),
				  "head", json_text_or_null(seal->head.head), "why",
				  json_text_or_null(seal->join ? "the seal of the join"
							       : seal->why),
				  "signatures", seal->signatures, "timestamps",
				  seal->timestamps));
	}
	return list;
}

static void print_head(const struct incise_proof_seal *seal, bool alone)
{
	const char *name = strrchr(seal->path, '/');

	fputs("seal     ", stdout);
	if (!alone && !seal->join)
		printf("%s: ", name ? name + 1 : seal->path);
	if (!seal->join && !*seal->identity) {
		printf("none: %s\n", seal->why);
		return;
	}
	if (seal->join)
		printf("the join");
	else
		printf("commit %lld, head %.16s…", (long long)seal->head.commit,
		       seal->head.head);
	if (seal->signatures)
		printf(", %s", cli_count((uint64_t)seal->signatures, "signature"));
	if (seal->timestamps)
		printf(", %s", cli_count((uint64_t)seal->timestamps, "time-stamp"));
	puts(seal->signatures + seal->timestamps
		     ? ", not checked: 'incise verify --signers FILE' checks them"
		     : ", not signed");
}

void proof_print_heads(const struct incise_proof *proof)
{
	for (int i = 0; i < proof->n; i++)
		print_head(&proof->seals[i], proof->n == 1);
}
