// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * exhaustive MODEL.fis [direct|table|force]: a compiled model against double on all 2^32
 * pairs of 65536 evenly spaced values of each input, held against the certified bound.
 * `make check-exhaustive` runs it; half a minute on two cores.
 *
 * The reference is separable: normalised degrees of each input are computed once for
 * each of its 65536 values, and a pair costs a few multiplications.
 */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/fixed.h>
#include <incise/model.h>

#define VALUES 65536
#define MFS INCISE_FIXED_MFS_MAX
#define THREADS_MAX 64

struct input {
	int n;
	int32_t q[VALUES];	    /* Q16.16 */
	double x[VALUES];	    /* the same, exactly */
	double degree[VALUES][MFS]; /* normalised */
};

struct job {
	const struct incise_model *model;
	const struct incise_fixed *fx;
	const struct input *a, *b;
	int from, to; /* values of input a */
	double largest, sum2;
	double at[2];
};

static void fill(struct input *in, const struct incise_model *model,
		 const struct incise_fixed *fx, int i)
{
	int64_t range = (int64_t)fx->input[i].max - fx->input[i].min;

	in->n = incise_model_info(model)->n_mfs[i];
	for (int k = 0; k < VALUES; k++) {
		double sum = 0, logs[MFS], largest = -INFINITY;

		in->q[k] = (int32_t)(fx->input[i].min + range * k / (VALUES - 1));
		in->x[k] = in->q[k] / (double)INCISE_FIXED_ONE;
		for (int j = 0; j < in->n; j++) {
			const struct incise_mf *mf = incise_model_mf(model, i, j);
			double z = (in->x[k] - mf->p[1]) / mf->p[0];

			logs[j] = -z * z / 2;
			largest = fmax(largest, logs[j]);
		}
		for (int j = 0; j < in->n; j++)
			sum += in->degree[k][j] = exp(logs[j] - largest);
		for (int j = 0; j < in->n; j++)
			in->degree[k][j] /= sum;
	}
}

static void *run(void *user)
{
	struct job *job = user;
	const struct input *a = job->a, *b = job->b;
	int32_t *x = malloc(VALUES * 2 * sizeof(*x)),
		*fixed = malloc(VALUES * sizeof(*fixed));

	if (!x || !fixed) {
		job->largest = INFINITY;
		goto out;
	}
	for (int l = 0; l < VALUES; l++)
		x[2 * l + 1] = b->q[l];
	for (int k = job->from; k < job->to; k++) {
		double c[MFS] = {0}, d[MFS] = {0};

		/* y = Σj b(j) (c(j) + d(j)·xb) */
		for (int i = 0; i < a->n; i++)
			for (int j = 0; j < b->n; j++) {
				const double *p =
					incise_model_rule(job->model, i * b->n + j)->p;

				c[j] += a->degree[k][i] * (p[0] + p[1] * a->x[k]);
				d[j] += a->degree[k][i] * p[2];
			}
		/* Bit-identical to one by one, and quicker. */
		for (int l = 0; l < VALUES; l++)
			x[2 * l] = a->q[k];
		incise_fixed_eval_batch(job->fx, x, fixed, VALUES);
		for (int l = 0; l < VALUES; l++) {
			double y = 0, e;

			for (int j = 0; j < b->n; j++)
				y += b->degree[l][j] * (c[j] + d[j] * b->x[l]);
			e = fabs(fixed[l] * (1.0 / INCISE_FIXED_ONE) - y);
			job->sum2 += e * e;
			if (e > job->largest) {
				job->largest = e;
				job->at[0] = a->x[k];
				job->at[1] = b->x[l];
			}
		}
	}
out:
	free(x);
	free(fixed);
	return NULL;
}

static int parse_arithmetic(const char *name)
{
	for (int a = INCISE_FIXED_DIRECT; a <= INCISE_FIXED_FORCE; a++)
		if (!strcmp(name, incise_fixed_arithmetic_name(a)))
			return a;
	fprintf(stderr, "exhaustive: '%s' is none of direct, table and force\n", name);
	exit(2);
}

int main(int argc, char **argv)
{
	struct input *a = malloc(sizeof(*a)), *b = malloc(sizeof(*b));
	struct incise_fixed_options o;
	struct incise_error err = {0};
	struct job job[THREADS_MAX] = {0};
	pthread_t thread[THREADS_MAX];
	long n = sysconf(_SC_NPROCESSORS_ONLN);
	struct incise_model *model;
	struct incise_fixed *fx;
	double sum2 = 0;

	if (argc < 2 || argc > 3 || !a || !b) {
		fprintf(stderr, "usage: exhaustive MODEL.fis [direct|table|force]\n");
		return 2;
	}
	incise_fixed_options_init(&o);
	if (argc == 3) {
		o.arithmetic = parse_arithmetic(argv[2]);
		o.budget = 0;
		o.cells = o.arithmetic == INCISE_FIXED_TABLE ? 512 : 0;
	}
	model = incise_model_load(argv[1], &err);
	fx = model ? incise_fixed_compile(model, &o, &err) : NULL;
	if (!fx || fx->n_inputs != 2) {
		fprintf(stderr, "exhaustive: %s\n",
			fx ? "two inputs are needed" : err.text);
		return 1;
	}
	fill(a, model, fx, 0);
	fill(b, model, fx, 1);
	n = n < 1 ? 1 : n > THREADS_MAX ? THREADS_MAX : n;
	for (int t = 0; t < n; t++) {
		job[t] = (struct job){.model = model, .fx = fx, .a = a, .b = b};
		job[t].from = (int)((int64_t)VALUES * t / n);
		job[t].to = (int)((int64_t)VALUES * (t + 1) / n);
		if (pthread_create(&thread[t], NULL, run, &job[t])) {
			fprintf(stderr, "exhaustive: no thread could be made\n");
			return 1;
		}
	}
	for (int t = 0; t < n; t++) {
		pthread_join(thread[t], NULL);
		sum2 += job[t].sum2;
		if (job[t].largest > job[0].largest)
			job[0] = job[t];
	}
	printf("%s, %s: %lld pairs, largest error %.4g at (%.6g, %.6g), rms %.3g, certified "
	       "%.4g\n",
	       argv[1], incise_fixed_arithmetic_name(fx->arithmetic),
	       (long long)VALUES * VALUES, job[0].largest, job[0].at[0], job[0].at[1],
	       sqrt(sum2 / VALUES / VALUES), incise_fixed_bound(fx));
	if (!(job[0].largest <= incise_fixed_bound(fx))) {
		fprintf(stderr, "exhaustive: the error exceeds its certified bound\n");
		return 1;
	}
	incise_fixed_free(fx);
	incise_model_free(model);
	free(a);
	free(b);
	return 0;
}
