mod captures;
mod clouds;
mod degenerate;
mod shapes;
mod sphere;

use clouds::*;
