// SPDX-License-Identifier: GPL-2.0-or-later
/* The seal of a recording, for people and as JSON; see seal_report.h. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "members.h"
#include "seal.h"
#include "seal_report.h"

#define JOIN "the seal of the join"

static json_t *one(const char *path)
{
	struct incise_error err = {.text = ""};
	struct incise_seal_head head;
	struct seal_files files;
	char identity[33], why[200] = JOIN, *join = seal_join(path);
	bool has = !join && seal_head(path, identity, &head, why);
	int n[3] = {0};

	free(join);

	if (seal_files_read(&files, path, "seal", &err))
		cli_fail_with(&err);
	for (int i = 0; i < files.n; i++)
		n[files.all[i].kind]++;
	seal_files_free(&files);
	return json_pack("{so so so so so si si}", "path", json_text(path), "identity",
			 has ? json_text(identity) : json_null(), "commit",
			 has ? json_integer((json_int_t)head.commit) : json_null(),
			 "head", has ? json_text(head.head) : json_null(), "why",
			 has ? json_null() : json_text(why), "signatures",
			 n[SEAL_SIGNATURE], "timestamps", n[SEAL_TIMESTAMP]);
}

json_t *seal_report_json(const char *path)
{
	json_t *list = json_array();
	struct members members;

	members_find(&members, path);
	for (int i = 0; i < members.n; i++)
		json_array_append_new(list, one(members.path[i]));
	members_free(&members);
	return list;
}

static void count(const json_t *at, const char *key, const char *what)
{
	json_int_t n = json_integer_value(json_object_get(at, key));

	if (n)
		printf(", %s", cli_count((uint64_t)n, what));
}

void seal_report_print(const json_t *list)
{
	size_t i;
	json_t *at;

	json_array_foreach(list, i, at)
	{
		const char *path = json_string_value(json_object_get(at, "path"));
		const char *head = json_string_value(json_object_get(at, "head"));

		const char *why = json_string_value(json_object_get(at, "why"));
		bool join = why && !strcmp(why, JOIN);

		fputs("seal     ", stdout);
		if (json_array_size(list) > 1 && !join)
			printf("%s: ",
			       strrchr(path, '/') ? strrchr(path, '/') + 1 : path);
		if (join) {
			printf("the join");
		} else if (!head) {
			printf("none: %s\n", why);
			continue;
		} else {
			printf("commit %lld, head %.16s…",
			       (long long)json_integer_value(
				       json_object_get(at, "commit")),
			       head);
		}
		count(at, "signatures", "signature");
		count(at, "timestamps", "time-stamp");
		puts(json_integer_value(json_object_get(at, "signatures")) +
				     json_integer_value(json_object_get(at, "timestamps"))
			     ? ", not checked: 'incise verify --signers FILE' checks them"
			     : ", not signed");
	}
}
