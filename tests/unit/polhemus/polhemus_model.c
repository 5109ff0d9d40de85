// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/device/polhemus/polhemus_model.c: what is known, and what is not. */
#include "../unit.h"
#include "../../../lib/device/polhemus/polhemus_model.h"

TEST(products)
{
	static const struct {
		uint16_t vendor, product;
		int family; /* -1: not known */
		bool ready;
	} cases[] = {
		{0x0f44, 0x0001, POLHEMUS_FASTRAK, false},
		{0x0f44, 0x0002, POLHEMUS_FASTRAK, true},
		{0x0f44, 0x0003, POLHEMUS_FASTRAK, true},
		{0x0f44, 0xff11, POLHEMUS_LIBERTY, false},
		{0x0f44, 0xff12, POLHEMUS_LIBERTY, true},
		{0x0f44, 0xff20, POLHEMUS_LIBERTY, true},
		{0x0f44, 0xff21, POLHEMUS_LIBERTY, false},
		{0x0f44, 0xef11, POLHEMUS_PATRIOT, false},
		{0x0f44, 0xef12, POLHEMUS_PATRIOT, true},
		{0x0f44, 0xef20, POLHEMUS_PATRIOT, true},
		{0x0f44, 0xef21, POLHEMUS_PATRIOT, false},
		{0x0f44, 0x0000, -1, false},
		{0x0f44, 0x0004, -1, false},
		{0x0f45, 0x0002, -1, false},
		{0x0000, 0x0002, -1, false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct polhemus_model *model =
			polhemus_model_find(cases[i].vendor, cases[i].product);

		if (cases[i].family < 0) {
			assert_null(model);
			continue;
		}
		assert_non_null(model);
		assert_int_equal(model->family, cases[i].family);
		assert_int_equal(model->ready, cases[i].ready);
		/* "LIBERTY HS" is a LIBERTY. */
		assert_memory_equal(model->name, polhemus_family_name(model->family),
				    strlen(polhemus_family_name(model->family)));
	}
}

/* A FASTRAK shares its 120 Hz; the others have their rate for each station. */
TEST(rates)
{
	static const double hz[] = {120, 240, 60};

	for (int family = 0; family < 3; family++)
		for (int n = 1; n <= POLHEMUS_STATIONS; n++)
			assert_true(polhemus_family_hz((enum polhemus_family)family, n) ==
				    (family == POLHEMUS_FASTRAK ? 120 : hz[family] * n));
}
