// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of tools/web/series.c: columns have the extremes of their samples, whatever the samples, and JSON that a
 * reader takes.
 */
#include <math.h>
#include <string.h>
#include <jansson.h>
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../tools/web/web.h"

#define SAMPLES 3000

struct drawn {
	int n;
	double x[SAMPLES], y[SAMPLES];
};

static double share(uint64_t *rng)
{
	return fabs(incise_random_symmetric(rng));
}

/* Samples in order, some out of the range, some missing. */
static void draw_samples(struct drawn *drawn, uint64_t *rng)
{
	double x = -0.1;

	drawn->n = 1 + (int)(share(rng) * (SAMPLES - 1));
	for (int i = 0; i < drawn->n; i++) {
		x += share(rng) * 2.4 / drawn->n;
		drawn->x[i] = x;
		drawn->y[i] = share(rng) < 0.05 ? NAN : 200 * share(rng) - 100;
	}
}

static json_t *series_json(const struct web_series *series, double from, double to,
			   int columns)
{
	char *text = NULL;
	size_t n;
	FILE *out = open_memstream(&text, &n);
	json_t *object;

	web_series_put(series, from, to, columns, NULL, NULL, out);
	fclose(out);
	object = json_loads(text, 0, NULL);
	assert_non_null(object);
	free(text);
	return object;
}

/* No sample is outside of its column by more than a span, and both extremes of all are there. */
static void check_columns(const struct drawn *drawn, const json_t *columns, double from,
			  double to, int n, double span)
{
	const json_t *low = json_object_get(columns, "low"),
		     *high = json_object_get(columns, "high");

	assert_int_equal(json_array_size(low), n);
	for (int i = 0; i < drawn->n; i++) {
		bool found = false;

		if (isnan(drawn->y[i]) || drawn->x[i] < from + span ||
		    drawn->x[i] > to - span || drawn->x[i] > 1)
			continue;
		for (int k = 0; k < n; k++) {
			double begin = from + (to - from) * k / n;

			if (drawn->x[i] < begin - span ||
			    drawn->x[i] > begin + (to - from) / n + span ||
			    json_is_null(json_array_get(low, (size_t)k)))
				continue;
			found |= drawn->y[i] >= json_number_value(
							json_array_get(low, (size_t)k)) -
							1e-3 &&
				 drawn->y[i] <= json_number_value(
							json_array_get(high, (size_t)k)) +
							1e-3;
		}
		assert_true(found);
	}
}

TEST(columns_have_the_extremes_of_their_samples)
{
	static struct drawn drawn;
	uint64_t rng = 1;

	for (int round = 0; round < 200; round++) {
		int spans = 1 + (int)(share(&rng) * 2000),
		    columns = 1 + (int)(share(&rng) * 300);
		double from = share(&rng), to = from + 0.01 + share(&rng);
		struct web_series series;
		json_t *object;

		draw_samples(&drawn, &rng);
		web_series_init(&series, 0, 1, spans, 0);
		for (int i = 0; i < drawn.n; i++)
			web_series_add(&series, drawn.x[i], drawn.y[i]);
		object = series_json(&series, from, to, columns);
		if (json_object_get(object, "low"))
			check_columns(&drawn, object, from, to, columns, 1.0 / spans);
		else
			assert_int_equal(json_array_size(json_object_get(object, "x")),
					 0);
		json_decref(object);
		web_series_free(&series);
	}
}

TEST(few_samples_come_as_they_are)
{
	struct web_series series;
	json_t *object, *y;

	web_series_init(&series, 0, 1, 10, 10);
	web_series_add(&series, 0.1, NAN);
	web_series_add(&series, 0.1, 1);
	web_series_add(&series, 0.2, 2);
	web_series_add(&series, 0.3, NAN);
	web_series_add(&series, 0.3, NAN);
	web_series_add(&series, 0.4, -3);
	web_series_add(&series, 1.1, 4);
	object = series_json(&series, 0, 1, 10);
	y = json_object_get(object, "y");
	assert_int_equal(json_array_size(y), 4);
	assert_true(json_number_value(json_array_get(y, 1)) == 2);
	assert_true(json_is_null(json_array_get(y, 2)));
	assert_true(json_number_value(json_array_get(y, 3)) == -3);
	json_decref(object);
	web_series_free(&series);
}
