// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Training from sources: it ends at any call of its progress and leaves nothing but that, from which
 * the next one goes on to the same model; and processes that share the sources find the same model,
 * or all fail of the same.
 */
#include "../unit.h"
#include <pthread.h>
#include <sys/stat.h>
#include <incise/corpus.h>
#include "../../../lib/base/random.h"
#include "../cases.h"

#define SOURCES 3
#define RANKS 3

static char folder[] = "/tmp/incise-train-XXXXXX", names[SOURCES][64], kept[64];
static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N",
				      "force_u_noise_N"};
static const struct incise_propagation_part own_part = {.of = 2, .source = -1};

static void write_source(int number)
{
	FILE *out = fopen(names[number], "w");

	assert_non_null(out);
	fprintf(out, "cut,%s,%s,%s,%s\n", columns[0], columns[1], columns[2], columns[3]);
	for (int i = 0; i < 240; i++) {
		double d = (i * 7919 + number * 13) % 1000 / 50.0;
		double v = (i * 104729 + number * 7) % 997 / 20.0;

		fprintf(out, "c%d,%.6f,%.6f,%.6f,%.6f\n", i / 40, d, v,
			0.05 * d * (1 + v / (v + 15)) + 0.01 * ((i * 31) % 7),
			0.01 + 0.001 * (i % 5));
	}
	assert_int_equal(fclose(out), 0);
}

static int make_folder(void **state)
{
	(void)state;
	if (!mkdtemp(folder))
		return -1;
	snprintf(kept, sizeof(kept), "%s/m.fis.progress", folder);
	for (int i = 0; i < SOURCES; i++) {
		snprintf(names[i], sizeof(names[i]), "%s/s%d.csv", folder, i);
		write_source(i);
	}
	return 0;
}

static int remove_folder(void **state)
{
	(void)state;
	for (int i = 0; i < SOURCES; i++)
		unlink(names[i]);
	unlink(kept);
	return rmdir(folder);
}

GROUP(make_folder, remove_folder);

struct stopping {
	int calls, at; /* the call that ends the training; 0: none */
	int resumed;
	bool added; /* reached the sums */
};

static int stop_at(void *user, const struct incise_train_step *step)
{
	struct stopping *stopping = user;

	stopping->resumed += step->resumed;
	stopping->added |= step->phase == INCISE_TRAIN_ADD;
	return ++stopping->calls == stopping->at;
}

/* Ways to train; *premises is for those that need them. */
enum way { DEFAULT, HELD_OUT, CHOSEN, CLASSIC, WEIGHTED, PREMISES, FACTOR, WAYS };

static struct incise_sources_options make_options(enum way way,
						  const struct incise_model *premises)
{
	struct incise_sources_options options = {
		.columns = columns,
		.n_inputs = 2,
		.n_mfs = {2, way == CHOSEN ? 0 : 2},
		.check = way == HELD_OUT || way == CLASSIC ? 0.3 : 0,
		.premises = way >= PREMISES ? premises : NULL,
		.end = way == FACTOR ? INCISE_TRAIN_TO_FACTOR : INCISE_TRAIN_TO_MODEL,
	};

	incise_train_options_init(&options.train);
	options.train.epochs = 4;
	options.train.classic = way == CLASSIC;
	if (way == CHOSEN)
		options.n_mfs[0] = 0;
	if (way == WEIGHTED) {
		options.parts = &own_part;
		options.n_parts = 1;
	}
	return options;
}

static int train(const struct incise_sources_options *options,
		 struct incise_trained *trained, struct incise_error *error)
{
	struct incise_train_source sources[SOURCES] = {0};

	for (int i = 0; i < SOURCES; i++)
		sources[i].name = sources[i].path = names[i];
	return incise_train_sources(sources, SOURCES, options, trained, error);
}

static void same_models(const struct incise_model *a, const struct incise_model *b)
{
	int n = incise_model_info(a)->n_rules;

	assert_int_equal(n, incise_model_info(b)->n_rules);
	for (int r = 0; r < n; r++)
		for (int i = 0; i < 3; i++)
			assert_true(incise_model_rule(a, r)->p[i] ==
				    incise_model_rule(b, r)->p[i]);
}

/* Some calls of each way: all have to end it, and it is not called again. */
TEST(test_stopped_at_any_call)
{
	struct incise_sources_options options = make_options(DEFAULT, NULL);
	struct incise_trained start, trained;

	assert_int_equal(train(&options, &start, &err), 0);
	for (enum way way = DEFAULT; way < WAYS; way++) {
		struct stopping whole = {0};
		int most = cases_of(100, 3);

		options = make_options(way, start.model);
		options.train.progress = stop_at;
		options.train.user = &whole;
		assert_int_equal(train(&options, &trained, &err), 0);
		assert_true(way == FACTOR ? !trained.model : !!trained.model);
		assert_true(whole.added || way == CLASSIC);
		incise_trained_free(&trained);
		assert_true(whole.calls > 1);
		for (int i = 0; i < most && i < whole.calls; i++) {
			struct stopping stopping = {
				.at = whole.calls <= most
					      ? i + 1
					      : 1 + (int)((long)i * (whole.calls - 1) /
							  (most - 1))};

			options.train.user = &stopping;
			assert_error(train(&options, &trained, &err), ECANCELED, &err,
				     NULL);
			assert_int_equal(stopping.calls, stopping.at);
			assert_true(!trained.notes);
			incise_trained_free(&trained);
		}
	}
	incise_trained_free(&start);
}

/* A training that was stopped while it read goes on from its progress, which is then removed. */
TEST(test_goes_on)
{
	struct incise_sources_options options = make_options(HELD_OUT, NULL);
	struct stopping whole = {0}, next;
	struct incise_trained wanted, trained;
	bool resumed = false;

	options.train.progress = stop_at;
	options.train.user = &whole;
	assert_int_equal(train(&options, &wanted, &err), 0);
	options.progress = kept;
	for (int at = 1; at <= whole.calls; at += 1 + whole.calls / cases_of(15, 4)) {
		struct stopping stopping = {.at = at};

		next = (struct stopping){0};
		options.train.user = &stopping;
		assert_int_equal(train(&options, &trained, NULL), -ECANCELED);
		incise_trained_free(&trained);
		options.train.user = &next;
		assert_int_equal(train(&options, &trained, &err), 0);
		same_models(wanted.model, trained.model);
		assert_int_equal(trained.pairs, wanted.pairs);
		assert_true(trained.report.check_rmse == wanted.report.check_rmse);
		incise_trained_free(&trained);
		assert_int_equal(access(kept, F_OK), -1);
		resumed |= next.resumed > 0;
	}
	assert_true(resumed);
	/* Of other options it is not used. */
	options.train.user = &(struct stopping){.at = whole.calls};
	assert_int_equal(train(&options, &trained, NULL), -ECANCELED);
	incise_trained_free(&trained);
	next = (struct stopping){0};
	options.train.user = &next;
	options.train.seed = 2;
	assert_int_equal(train(&options, &trained, &err), 0);
	assert_int_equal(next.resumed, 0);
	incise_trained_free(&trained);
	incise_trained_free(&wanted);
}

/* --- processes, as threads ----------------------------------------------------------- */

static pthread_barrier_t all_there;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t moved = PTHREAD_COND_INITIALIZER;
static _Thread_local int me;
static struct message {
	const void *bytes; /* of a gathering */
	size_t n;
	void *mail; /* from this rank to the one that it sends to */
	size_t mail_n;
} message[RANKS];

static int gather(const void *bytes, size_t n, void **all, size_t **sizes)
{
	size_t total = 0;
	char *to;

	message[me].bytes = bytes;
	message[me].n = n;
	pthread_barrier_wait(&all_there);
	for (int r = 0; r < RANKS; r++)
		total += message[r].n;
	*all = to = malloc(total + 1);
	*sizes = malloc(RANKS * sizeof(**sizes));
	for (int r = 0; r < RANKS; to += message[r++].n) {
		(*sizes)[r] = message[r].n;
		if (message[r].n)
			memcpy(to, message[r].bytes, message[r].n);
	}
	pthread_barrier_wait(&all_there);
	return 0;
}

static void send_bytes(int rank, const void *bytes, size_t n)
{
	(void)rank;
	pthread_mutex_lock(&lock);
	while (message[me].mail)
		pthread_cond_wait(&moved, &lock);
	message[me].mail = malloc(n);
	message[me].mail_n = n;
	memcpy(message[me].mail, bytes, n);
	pthread_cond_broadcast(&moved);
	pthread_mutex_unlock(&lock);
}

static void *receive_bytes(int rank, size_t *n)
{
	void *mail;

	pthread_mutex_lock(&lock);
	while (!message[rank].mail)
		pthread_cond_wait(&moved, &lock);
	mail = message[rank].mail;
	*n = message[rank].mail_n;
	message[rank].mail = NULL;
	pthread_cond_broadcast(&moved);
	pthread_mutex_unlock(&lock);
	return mail;
}

struct process {
	struct incise_ranks ranks;
	struct incise_sources_options options;
	struct stopping stopping;
	struct incise_trained trained;
	struct incise_error err;
	int rc;
};

static void *run_process(void *user)
{
	struct process *process = user;

	me = process->ranks.rank;
	process->rc = train(&process->options, &process->trained, &process->err);
	return NULL;
}

/* Where stopped is a rank, its first call ends its training. */
static void train_together(struct process *processes, enum way way,
			   const struct incise_model *premises, int stopped)
{
	pthread_t threads[RANKS];

	assert_int_equal(pthread_barrier_init(&all_there, NULL, RANKS), 0);
	for (int r = 0; r < RANKS; r++) {
		struct process *process = &processes[r];

		*process = (struct process){
			.ranks = {r, RANKS, gather, send_bytes, receive_bytes, NULL},
			.options = make_options(way, premises),
			.stopping.at = r == stopped,
		};
		process->options.ranks = &process->ranks;
		process->options.train.progress = stop_at;
		process->options.train.user = &process->stopping;
		assert_int_equal(pthread_create(&threads[r], NULL, run_process, process),
				 0);
	}
	for (int r = 0; r < RANKS; r++)
		pthread_join(threads[r], NULL);
	pthread_barrier_destroy(&all_there);
}

TEST(test_processes_find_the_same)
{
	static struct process processes[RANKS];
	struct incise_sources_options options = make_options(DEFAULT, NULL);
	struct incise_trained start, wanted;

	assert_int_equal(train(&options, &start, &err), 0);
	for (int way = 0; way < 2; way++) {
		options = make_options(way ? PREMISES : HELD_OUT, start.model);
		assert_int_equal(train(&options, &wanted, &err), 0);
		train_together(processes, way ? PREMISES : HELD_OUT, start.model, -1);
		for (int r = 0; r < RANKS; r++) {
			struct incise_trained *trained = &processes[r].trained;

			assert_int_equal(processes[r].rc, 0);
			assert_true(trained->shared && !r == !!trained->model);
			if (!r) {
				same_models(wanted.model, trained->model);
				assert_string_equal(wanted.notes, trained->notes);
				assert_true(way || wanted.report.check_rmse ==
							   trained->report.check_rmse);
			}
			incise_trained_free(trained);
		}
		incise_trained_free(&wanted);
	}
	incise_trained_free(&start);
}

/* One that is stopped, then a source that is missing. */
TEST(test_processes_fail_of_the_same)
{
	static struct process processes[RANKS];

	for (int fault = 0; fault < 2; fault++) {
		if (fault)
			unlink(names[1]);
		train_together(processes, DEFAULT, NULL, fault ? -1 : 2);
		for (int r = 0; r < RANKS; r++) {
			assert_int_equal(processes[r].rc, fault ? -ENOENT : -ECANCELED);
			if (fault)
				assert_says(processes[r].err.text, names[1]);
			assert_true(processes[r].trained.shared);
			incise_trained_free(&processes[r].trained);
		}
	}
	write_source(1);
}

TEST(test_weights_are_of_one_process)
{
	struct incise_sources_options options = make_options(WEIGHTED, NULL);
	struct incise_trained trained;

	options.ranks = &(struct incise_ranks){.size = 2};
	assert_error(train(&options, &trained, &err), EINVAL, &err, "one process");
	incise_trained_free(&trained);
}

/* --- further inputs --- */

/*
 * Cuts at a speed of their own that wobbles, whose force differs by cut and decays with time; two columns have
 * no number in all rows, and a third is of chance.
 */
static void write_cuts(uint64_t seed, double spread, double decay_s)
{
	FILE *out = fopen(names[0], "w");

	assert_non_null(out);
	fprintf(out, "cut,depth_mm,velocity_mm_s,time,nan,chance,force_N\n");
	for (int cut = 0; cut < 24; cut++) {
		double factor = 1 + spread * incise_random_symmetric(&seed), d = 0;
		double own = 17 + 12 * incise_random_symmetric(&seed);
		double phase = 3 * incise_random_symmetric(&seed), step_s = 0.4 / own;

		for (int i = 0; i < 30; i++) {
			double t = i * step_s, v = own * (1 + 0.4 * sin(6 * t + phase));
			double force = factor * (0.2 * d + 0.01 * d * d + 0.02 * v) *
				       exp(-t / decay_s);

			fprintf(out, "c%d,%.5f,%.5f,%.5f,%s,%.5f,%.5f\n", cut, d, v, t,
				i == 7 ? "nan" : "1", incise_random_symmetric(&seed),
				force + 0.1 * incise_random_symmetric(&seed));
			d += v * step_s;
		}
	}
	assert_int_equal(fclose(out), 0);
}

/* The further input that is found. */
static void check_further(uint64_t seed, double spread, double decay_s,
			  const char *wanted)
{
	static const char *const all[] = {"depth_mm", "velocity_mm_s", "force_N", "nan",
					  "chance",   "missing",       "time"};
	struct incise_train_source source = {.name = names[0], .path = names[0]};
	struct incise_sources_options options = make_options(DEFAULT, NULL);
	struct incise_trained trained;

	write_cuts(seed, spread, decay_s);
	options.columns = all;
	options.n_further = 4;
	options.n_mfs[0] = 5;
	options.n_mfs[1] = 4;
	assert_int_equal(incise_train_sources(&source, 1, &options, &trained, &err), 0);
	if (wanted) {
		assert_non_null(trained.better);
		assert_string_equal(trained.better, wanted);
		assert_true(trained.better_rmse < 0.95 * trained.report.crossval_rmse);
	} else {
		assert_null(trained.better);
	}
	incise_trained_free(&trained);
}

TEST(test_further_input_where_force_has_history)
{
	for (int seed = 1; seed <= cases_of(20, 4); seed++) {
		check_further(seed, 0.1, 0.5, "time");
		check_further(seed, 0.4, INFINITY, NULL);
	}
	write_source(0);
}

/* Held-out pairs of one cut are no evidence. */
TEST(test_further_input_needs_groups)
{
	struct incise_train_source source = {.name = names[0], .path = names[0]};
	struct incise_sources_options options = make_options(DEFAULT, NULL);
	static const char *const all[] = {"depth_mm", "velocity_mm_s", "force_N", "time"};
	struct incise_trained trained;

	write_cuts(1, 0.1, 0.5);
	options.columns = all;
	options.n_further = 1;
	options.group = "none";
	assert_int_equal(incise_train_sources(&source, 1, &options, &trained, &err), 0);
	assert_null(trained.better);
	incise_trained_free(&trained);
	write_source(0);
}
