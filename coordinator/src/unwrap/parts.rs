//! One surface: the author's layout where it is good, else charts for each of its parts, packed together.

use super::{
    Charts, Wanted, atlas,
    author::{Author, Unusable},
    chart::{self, Chart, DoesNotFit, Origin},
    check, flat,
};
use crate::records::Problem;
use kiln_proto::{
    plan::{ChartSource, SurfacePlan},
    scene::{Scene, Surface},
};

/// The coordinate sets that may hold light, in the order in which they are tried.
const SETS: [usize; 2] = [1, 0];

/// Charts over the edges of flat triangles must save this much of the texels: what lies between texels of two of them is a mixture of light
/// in two frames.
const WORTH: f64 = 2.0 / 3.0;

/// Lays out a surface by itself.
pub(super) fn lay_out(scene: &Scene, surface: &Surface, wanted: Wanted, warnings: &mut Vec<Problem>) -> Result<SurfacePlan, Problem> {
    let mut warn = |message: String| warnings.push(Problem::new(format!("surface `{}`: {message}", surface.name)));
    let all: Vec<u32> = (0..surface.triangles.len() as u32).collect();
    let maker = Maker { scene, surface, density: density(scene, surface, wanted) };
    let (mut why, mut kept) = (None, vec![]);
    for set in SETS.into_iter().filter(|set| *set < surface.uv_sets.len()) {
        let read = Author::read(scene, surface, set, &all);
        match read.as_ref().map_err(|e| *e).and_then(|author| author.as_it_is(wanted)) {
            Ok((charts, note)) => {
                why.into_iter().for_each(|(set, why)| warn(format!("its texture coordinates of set {set} are not used, because {why}")));
                note.into_iter().for_each(&mut warn);
                return Ok(plan(ChartSource::Author, charts));
            }
            Err(Unusable::Missing) => {}
            Err(reason) => {
                kept.extend(reason.is_only_placement().then_some(set));
                why = why.or(Some((set, reason)));
            }
        }
    }
    let charts: Vec<Chart> = if surface.parts.len() == 1 { maker.charts(&all, &kept) } else { maker.each_part() };
    let source = if surface.parts.len() == 1 { source(&charts) } else { ChartSource::Parts };
    let (layout, note) = maker.settle(charts, wanted).map_err(|e| Problem::new(format!("surface `{}`: {e}", surface.name)))?;
    if let Some((_, why)) = why {
        let count = layout.charts.iter().max().map_or(0, |last| last + 1);
        warn(match source {
            ChartSource::Author => format!("its charts were packed anew, because {why}"),
            ChartSource::Parts => format!("its parts were laid out one by one into {count} charts, because {why}"),
            ChartSource::Atlas => format!("its texture coordinates were replaced by an atlas of {count} charts, because {why}"),
            _ => format!("its texture coordinates were replaced by {count} charts of flat polygons, because {why}"),
        });
    }
    note.into_iter().for_each(&mut warn);
    Ok(plan(source, layout))
}

fn plan(source: ChartSource, layout: Charts) -> SurfacePlan {
    SurfacePlan { size: layout.size, source, uv: layout.uv, charts: layout.charts, covered: 0, tiles: vec![] }
}

/// Texels per metre, about, for weighing one layout against another.
fn density(scene: &Scene, surface: &Surface, wanted: Wanted) -> f64 {
    match wanted {
        Wanted::Density(density) => density,
        Wanted::Size(size) => {
            let area: f64 = (0..surface.triangles.len() as u32).map(|t| atlas::area(scene, surface, t)).sum();
            (size.texels() as f64 / area.max(f64::MIN_POSITIVE)).sqrt()
        }
    }
}

/// What charts of one kind are called.
fn source(charts: &[Chart]) -> ChartSource {
    match charts.iter().map(|c| c.origin).max() {
        Some(Origin::Author) => ChartSource::Author,
        Some(Origin::Flattened) => ChartSource::Atlas,
        _ => ChartSource::Polygons,
    }
}

/// Makes the charts of one surface.
struct Maker<'a> {
    scene: &'a Scene,
    surface: &'a Surface,
    density: f64,
}

impl Maker<'_> {
    /// The charts of every part: the author's too, where all that may be wrong is how those of different parts lie to each other.
    fn each_part(&self) -> Vec<Chart> {
        let mut from = 0;
        let mut charts = vec![];
        for part in &self.surface.parts {
            let triangles: Vec<u32> = (from..from + part.triangles).collect();
            from += part.triangles;
            if !triangles.is_empty() {
                charts.extend(self.charts(&triangles, &SETS));
            }
        }
        charts
    }

    /// The charts of some triangles: those that the author has in one of these sets, or our own.
    fn charts(&self, triangles: &[u32], sets: &[usize]) -> Vec<Chart> {
        let read = |set: &usize| Author::read(self.scene, self.surface, *set, triangles).ok().filter(Author::is_even);
        sets.iter().find_map(read).map_or_else(|| self.own_charts(triangles), |author| author.to_charts())
    }

    fn own_charts(&self, triangles: &[u32]) -> Vec<Chart> {
        let planes = flat::planes(self.scene, self.surface, triangles);
        if planes.len() == 1 {
            return planes;
        }
        let Some(mut flattened) = atlas::flatten(self.scene, self.surface, triangles) else { return planes };
        flattened.extend(self.left_out(triangles, &flattened));
        let cost = |charts: &[Chart]| charts.iter().map(|c| c.cost(self.density)).sum::<f64>();
        let better =
            if self.surface.normals.is_empty() { cost(&flattened) < WORTH * cost(&planes) } else { flattened.len() < planes.len() };
        if better { flattened } else { planes }
    }

    /// Charts of the triangles that are in none.
    fn left_out(&self, triangles: &[u32], charts: &[Chart]) -> Vec<Chart> {
        let mut charted: Vec<u32> = charts.iter().flat_map(|c| c.triangles.iter().copied()).collect();
        charted.sort_unstable();
        let left: Vec<u32> = triangles.iter().copied().filter(|t| charted.binary_search(t).is_err()).collect();
        if left.is_empty() { vec![] } else { flat::planes(self.scene, self.surface, &left) }
    }

    /// Packs charts, and cuts those that turn out to cover a texel twice until none does: each cut makes smaller ones, down to triangles.
    fn settle(&self, mut charts: Vec<Chart>, wanted: Wanted) -> Result<(Charts, Option<String>), DoesNotFit> {
        loop {
            let (layout, note) = chart::arrange(self.surface.triangles.len(), &charts, wanted)?;
            let faulty = check::faulty_charts(&layout);
            let mut cut = false;
            charts = std::mem::take(&mut charts)
                .into_iter()
                .enumerate()
                .flat_map(|(id, chart)| {
                    let pieces = if faulty.contains(&(id as u32)) { flat::cut(self.scene, self.surface, &chart) } else { None };
                    cut |= pieces.is_some();
                    pieces.unwrap_or_else(|| vec![chart])
                })
                .collect();
            if !cut {
                return Ok((layout, note));
            }
        }
    }
}
