from drpt.gallery.figures import DIFFUSE, GLOSSY, course_plan
from drpt.render import Mode

COURSE = {
    *((DIFFUSE, "implicit", spp, bounces) for spp, bounces in ((512, 2), (1024, 2))),
    *((DIFFUSE, "implicit", 1024, bounces) for bounces in (3, 4)),
    *((DIFFUSE, "explicit", spp, 2) for spp in (1, 10)),
    *((DIFFUSE, "explicit", spp, bounces) for spp in (1, 10, 100) for bounces in (3, 4)),
    *((f"cornell-box-{size}-light", "implicit", 1024, 2) for size in ("medium", "small")),
    *((f"cornell-box-{size}-light", "explicit", 10, 2) for size in ("medium", "small")),
    *((GLOSSY, mode, 1024, bounces) for mode in ("implicit", "explicit") for bounces in (2, 3, 4)),
}


def shown(sampler: str, *modes: Mode) -> set[tuple[str, str, int, int]]:
    return {
        (s.scene, str(s.mode), s.spp, s.bounces)
        for figure in course_plan().figures
        for s in figure.settings
        if s.sampler == sampler and s.mode in modes
    }


def test_the_set_is_the_courses() -> None:
    assert shown("sobol", Mode.IMPLICIT, Mode.EXPLICIT) == COURSE


def test_independent_samples_stand_beside_all() -> None:
    assert shown("independent", *Mode) == shown("sobol", *Mode)


def test_mis_stands_beside_explicit_sampling() -> None:
    explicit = {(scene, *rest) for scene, _, *rest in shown("sobol", Mode.EXPLICIT)}
    assert {(scene, *rest) for scene, _, *rest in shown("sobol", Mode.MIS)} == explicit


def test_the_courses_own_pictures_are_known() -> None:
    course = course_plan().course
    assert {(s.scene, str(s.mode), s.spp, s.bounces) for s in course} == COURSE
    assert len(course) == len(COURSE)
