/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The proof of a recording, for people and as JSON.
 */
#ifndef INCISE_PROOF_REPORT_H
#define INCISE_PROOF_REPORT_H

#include <jansson.h>
#include <incise/prove.h>

/* A line for each difference, signature and time-stamp; without @signers their number. */
void proof_print(const struct incise_proof *proof, bool signers);

/* The same of incise verify. */
json_t *proof_json(const struct incise_proof *proof);

/* The seal of each recording, which was read and not verified. */
void proof_print_heads(const struct incise_proof *proof);
json_t *proof_heads_json(const struct incise_proof *proof);

#endif
