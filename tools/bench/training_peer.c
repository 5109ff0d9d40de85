// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Regressors of scikit-learn; see training_peer.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <jansson.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "../cli/file.h"
#include "training_peer.h"

#define WAIT_S 120
#define NOT_THERE 3 /* what the script ends with where there is no scikit-learn */

static const char *const names[TRAINING_PEERS] = {"gaussian_process", "neural_network",
						  "kernel_ridge"};

static json_t *rows_json(const double (*row)[3], int n)
{
	json_t *list = json_array();

	for (int i = 0; i < n; i++)
		json_array_append_new(list, json_pack("[fff]", row[i][0], row[i][1],
						      row[i][2]));
	return list;
}

/* Run it by one Python; its answer, or NULL with the reason. */
static json_t *ask(const char *python, const char *script, const char *question,
		   char *why, size_t size)
{
	char *argv[] = {(char *)python, (char *)script, (char *)question, NULL};
	struct memory_file answer = memory_file_begin("answer");
	json_t *got = NULL;
	int status;

	if (!child_possible(python)) {
		snprintf(why, size, "%s is not installed", python);
	} else if (access(script, R_OK)) {
		snprintf(why, size, "runs from the build tree only");
	} else {
		status = child_end(child_start(argv, fileno(answer.file), -1), WAIT_S);
		rewind(answer.file);
		if (WIFEXITED(status) && WEXITSTATUS(status) == NOT_THERE)
			snprintf(why, size,
				 "scikit-learn is not installed: apt-get install "
				 "python3-sklearn");
		else if (status)
			snprintf(why, size, "scikit-learn failed: status %d", status);
		else if (!(got = json_loadf(answer.file, 0, NULL)))
			snprintf(why, size, "scikit-learn's answer is no JSON");
	}
	fclose(answer.file);
	return got;
}

static void take(struct training_peer *peer, const json_t *answer, int seeds)
{
	const json_t *list = json_object_get(answer, peer->name);

	for (int s = 0; s < seeds; s++) {
		const json_t *one = json_array_get(list, (size_t)s);

		peer->ns[s] = json_number_value(json_object_get(one, "seconds")) * 1e9;
		peer->rmse[s] = json_number_value(json_object_get(one, "rmse"));
		peer->max[s] = json_number_value(json_object_get(one, "max"));
		peer->mean[s] = json_number_value(json_object_get(one, "mean"));
		if (!(peer->rmse[s] > 0))
			snprintf(peer->failed, sizeof(peer->failed),
				 "scikit-learn gave no figure");
	}
}

void training_peers(struct training_peer peers[TRAINING_PEERS],
		    const struct training_data *data, int seeds,
		    double unseen[TRAINING_UNSEEN][3])
{
	/* The first in PATH may be another than the system's, which has its packages. */
	static const char *const pythons[] = {"python3", "/usr/bin/python3"};
	struct memory_file question = memory_file_begin("question");
	json_t *all = json_object(), *sets = json_array(), *answer = NULL;
	char *script, why[sizeof(peers->failed)] = "";

	for (int s = 0; s < seeds; s++)
		json_array_append_new(sets, rows_json(data[s].row, TRAINING_PAIRS));
	json_object_set_new(all, "train", sets);
	json_object_set_new(all, "unseen",
			    rows_json((const double(*)[3])unseen, TRAINING_UNSEEN));
	if (asprintf(&script, "%s/../lib/incise/peer_scikit_learn.py", cli_folder()) <
		    0 ||
	    json_dumpf(all, question.file, 0))
		cli_fail("no memory");
	memory_file_written(&question);
	for (size_t i = 0; i < sizeof(pythons) / sizeof(*pythons) && !answer; i++)
		answer = ask(pythons[i], script, question.path, why, sizeof(why));
	for (int p = 0; p < TRAINING_PEERS; p++) {
		peers[p] = (struct training_peer){.name = names[p]};
		if (answer)
			take(&peers[p], answer, seeds);
		else
			snprintf(peers[p].failed, sizeof(peers[p].failed), "%s", why);
	}
	json_decref(answer);
	json_decref(all);
	free(script);
	fclose(question.file);
}
