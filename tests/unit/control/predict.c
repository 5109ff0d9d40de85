// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The gains of the pose predictor against the Riccati equation. Its filter, and strange trackers, are in
 * ../tissue/predict.c; how far it is off is in reference_path.c.
 */
#include "../unit.h"
#include "../../../lib/control/predict.h"

#define HAND_MM2_S5 4e6 /* of predict.c */

/*
 * Gains by iterating P ← F (P - K P₀) Fᵀ + Q in units of the period and of the noise,
 * with Q = Λ² g gᵀ, g = (1/2 1 1): acceleration takes an independent step each period.
 */
static void riccati(double index, double k[3])
{
	static const double f[3][3] = {{1, 1, 0.5}, {0, 1, 1}, {0, 0, 1}};
	static const double g[3] = {0.5, 1, 1};
	double p[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

	for (int n = 0; n < 20000; n++) {
		double c[3][3], fc[3][3];

		for (int i = 0; i < 3; i++)
			k[i] = p[i][0] / (p[0][0] + 1);
		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++)
				c[i][j] = p[i][j] - k[i] * p[0][j];
		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++)
				fc[i][j] = f[i][0] * c[0][j] + f[i][1] * c[1][j] +
					   f[i][2] * c[2][j];
		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++)
				p[i][j] = fc[i][0] * f[j][0] + fc[i][1] * f[j][1] +
					  fc[i][2] * f[j][2] +
					  index * index * g[i] * g[j];
	}
}

TEST(test_gains_are_kalmans)
{
	static const double hz[] = {30, 60, 120, 240, 1000};
	static const double noise_mm[] = {0.002, 0.02, 0.2};

	for (int i = 0; i < 5; i++) {
		for (int n = 0; n < 3; n++) {
			struct incise_tracker_info info = {
				.name = "test", .rate_hz = hz[i], .latency_ns = 4200000};
			struct incise_predict p;
			double k[3];

			incise_predict_init(&p, &info, noise_mm[n]);
			riccati(sqrt(HAND_MM2_S5 / hz[i]) / (hz[i] * hz[i]) / noise_mm[n],
				k);
			/* 2e4 steps of rounding, each 1e-16 of P's condition of 1e6. */
			assert_true(fabs(p.alpha - k[0]) < 1e-7 * k[0]);
			assert_true(fabs(p.beta - k[1]) < 1e-7 * k[1]);
			assert_true(fabs(p.gamma - k[2]) < 1e-7 * k[2]);
			if (n == 1) {
				struct incise_predict same;

				incise_predict_init(&same, &info, 0);
				assert_true(same.alpha == p.alpha &&
					    same.gamma == p.gamma);
			}
		}
	}
}
